// Digests of results, the same on every processor and with every instruction set. tools/test-arm64
// runs these tests in an emulator. Where a digest changes on purpose, the failed expectation names
// the new one.
#include <gtest/gtest.h>
#include <tbb/task_arena.h>

#include <cstdint>
#include <span>
#include <type_traits>
#include <vector>

#include "base/image/colour.h"
#include "capture/studio_wall.h"
#include "codec/coded_scene.h"
#include "codec/motion_scene.h"
#include "recon/motion/tracked_body.h"
#include "recon/pipeline/reconstructor.h"
#include "support/instruction_sets.h"

namespace v3d::recon {
namespace {

/// FNV-1a, 64 bits.
class Digest {
 public:
  template <class T>
  void add(std::span<const T> values) {
    static_assert(std::is_trivially_copyable_v<T>);
    const auto* bytes = reinterpret_cast<const uint8_t*>(values.data());
    for (size_t i = 0; i < values.size_bytes(); ++i) value_ = (value_ ^ bytes[i]) * 0x100000001B3U;
  }
  template <class T>
  void add(const std::vector<T>& values) {
    add(std::span<const T>(values));
  }
  void add(const std::vector<Eigen::Vector3f>& points) {
    for (const Eigen::Vector3f& p : points) add(std::span<const float>(p.data(), 3));
  }
  void add(const Mesh& mesh) {
    add(mesh.vertices);
    add(mesh.triangles);
    add(mesh.colours);
  }
  void add(const Mask& mask) {
    for (int y = 0; y < mask.size().height; ++y) add(mask.row(y));
  }
  uint64_t value() const { return value_; }

 private:
  uint64_t value_ = 0xCBF29CE484222325U;
};

template <class T>
uint64_t digest(const T& value) {
  Digest d;
  d.add(value);
  return d.value();
}

/// Eight cameras around (0, 0, 1). Their positions have short decimal fractions.
Rig rig() {
  const std::vector<Eigen::Vector3d> eyes{{2, 0, 1},      {1.2, 1.6, 1.75}, {0, 2, 0.5},
                                          {-1.6, 1.2, 1}, {-2, 0, 1.75},    {-1.2, -1.6, 0.5},
                                          {0, -2, 1.25},  {1.6, -1.2, 1.5}};
  Rig rig;
  for (const Eigen::Vector3d& eye : eyes) {
    rig.push_back({"cam" + std::to_string(rig.size()),
                   shapes::camera(eye, {0, 0, 1}, {240, 180}, 230, {-0.1, 0.02})});
  }
  return rig;
}

/// A painted ball with a box at its side, so that there is a concavity.
Mesh body() {
  Mesh mesh = shapes::sphere({0, 0, 1}, 0.3F, 40);
  shapes::append(mesh, shapes::box({0.35F, -0.1F, 0.75F}, {0.45F, 0.1F, 1.25F}));
  for (uint32_t v = 0; v < mesh.vertices.size(); ++v) {
    const uint32_t bits = codec::hash(v / 3, 5);
    mesh.colours.push_back({static_cast<uint8_t>(40 + bits % 180),
                            static_cast<uint8_t>(40 + bits / 256 % 180),
                            static_cast<uint8_t>(40 + bits / 65536 % 180)});
  }
  return mesh;
}

FrameSet frames() {
  const Mesh mesh = body();
  FrameSet set;
  set.pulse = 12;
  FrameLabel label;
  label.pulse = 12;
  for (const RigCamera& camera : rig()) {
    const Image raw = mosaic(draw_mesh(mesh, camera.model).view(), PixelFormat::kBayerRG8);
    set.frames.push_back(
        observe(camera.name, label, raw.view(), draw_silhouette(mesh, camera.model)));
  }
  return set;
}

Reconstruction reconstruct(Quality quality) {
  const ReconstructOptions options{.bounds = {{-0.6, -0.6, 0.4}, {0.6, 0.6, 1.6}},
                                   .voxel_m = 0.02,
                                   .min_views = 3,
                                   .quality = quality};
  return Reconstructor(rig(), options).reconstruct(frames());
}

TEST(EveryProcessor, draws_the_same_images_and_silhouettes) {
  Digest d;
  for (const Frame& frame : frames().frames) {
    d.add(frame.image.bytes);
    d.add(*frame.mask);
  }
  EXPECT_EQ(d.value(), 0x8CE23D42FFC017F5U);
}

TEST(EveryProcessor, makes_the_same_visual_hull_and_compact_frame) {
  on_every_instruction_set([] {
    const Reconstruction result = reconstruct(Quality::kLive);
    EXPECT_EQ(digest(result.mesh), 0xB119344F9CD06D6FU);
    EXPECT_EQ(digest(result.compact), 0x3A78D6DFB481E754U);
  });
}

TEST(EveryProcessor, deforms_the_same_surface_live) {
  on_every_instruction_set(
      [] { EXPECT_EQ(digest(reconstruct(Quality::kMedium).compact), 0x1D01A318A6D12C12U); });
}

TEST(EveryProcessor, carves_and_deforms_the_same_surface) {
  on_every_instruction_set(
      [] { EXPECT_EQ(digest(reconstruct(Quality::kHigh).compact), 0xD4BB46B56D1413D4U); });
}

TEST(EveryProcessor, segments_the_same_masks) {
  constexpr ImageSize kSize{200, 150};
  on_every_instruction_set([&] {
    Digest d;
    for (const PixelFormat format :
         {PixelFormat::kMono8, PixelFormat::kBayerRG8, PixelFormat::kRGB8}) {
      segmentation::Segmenter segmenter(capture::learn_wall(kSize, format), {});
      const auto scene = [](int x, int y) {
        return Rect{60, 30, 70, 90}.contains(x, y) ? capture::Colour{160, 60, 60}
                                                   : capture::wall(x, y);
      };
      d.add(segmenter.segment(capture::photograph(kSize, format, scene, 1).view()));
    }
    EXPECT_EQ(d.value(), 0x53C2B3837F8DE36BU);
  });
}

TEST(EveryProcessor, encodes_the_same_compact_frames_of_moved_vertices) {
  codec::FrameEncoder encoder({.key_every = 2});
  Digest d;
  for (const int pulse : {0, 1, 2}) {
    codec::Scene scene(codec::ball(8, 25 + pulse));
    scene.paint(3);
    scene.move(0.004);
    d.add(encoder.encode(scene.content(pulse)).value());
  }
  EXPECT_EQ(d.value(), 0x0BEB3DDDFAC7CAD1U);
}

TEST(EveryProcessor, encodes_the_same_motion_file) {
  codec::MotionSegment tube = codec::moving_tube(9);
  codec::paint(tube, 10);
  EXPECT_EQ(digest(codec::motion_file({tube})), 0x67EE4A19D47320F0U);
}

TEST(EveryProcessor, tracks_the_same_surface) {
  constexpr size_t kPulses = 3;
  const PulseSource source = [](size_t i) {
    return pulse_with(static_cast<int>(i), body_at(static_cast<int>(i)));
  };
  const TrackedSegment segment = track_segment(source, 0, 1, kPulses, kPulses, small_options());
  Digest d;
  d.add(segment.surface.triangles);
  for (const auto& positions : segment.positions) d.add(positions);
  EXPECT_EQ(d.value(), 0xACD7CA3898CBFDC6U);
}

}  // namespace
}  // namespace v3d::recon
