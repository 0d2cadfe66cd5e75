#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <optional>
#include <random>

#include "base/image/colour.h"
#include "recon/render/rasteriser.h"
#include "recon/shapes.h"
#include "recon/texture/texture.h"
#include "support/instruction_sets.h"

namespace v3d::recon {
namespace {

constexpr ImageSize kSize{200, 150};

/// A ball that fills the image, so that samples at the borders are tested, too.
const Mesh& ball() {
  static const Mesh kBall = shapes::sphere({0, 0, 0}, 0.6F, 44);
  return kBall;
}

/// Noise everywhere, to detect every wrong pixel.
Frame noise(PixelFormat format, bool with_mask) {
  std::mt19937 random(7);
  Image raw(kSize, format);
  for (uint8_t& byte : raw.bytes) {
    byte = static_cast<uint8_t>(random());
  }
  Mask mask(kSize);
  for (int y = 20; y < 140; ++y) {
    mask.fill_row(y, 60 - static_cast<int>(random() % 9), 160 + static_cast<int>(random() % 9));
  }
  Frame frame = observe("cam01", {}, raw.view(), mask);
  if (!with_mask) {
    frame.mask.reset();
    return frame;
  }
  frame.background_difference = mask;
  for (int y = 0; y < kSize.height; y += 3) {
    for (int x = 90; x < kSize.width; ++x) frame.background_difference->set(x, y, false);
  }
  return frame;
}

/// A depth buffer without occluders.
VertexCamera prepared(const CameraModel& model, const Frame& frame) {
  VertexCamera camera;
  camera.lens = VoxelCamera(model, {Eigen::Vector3d::Constant(-0.5), 1, {}});
  camera.axis = model.viewing_direction().cast<float>();
  camera.frame = &frame;
  camera.mask = ColourMask(frame);
  camera.depth = PointDepthBuffer(PointArrays{}, {0, 0, 0}, 0.01, model, camera.lens, frame.roi);
  return camera;
}

std::vector<ColourSums> see(const VertexCamera& camera) {
  const PointArrays vertices(ball().vertices), normals(vertex_normals(ball()));
  std::vector<ColourSums> blocks(vertices.blocks());
  for (size_t b = 0; b < blocks.size(); ++b) {
    accumulate_vertex_colours(camera, vertices, normals, b * PointArrays::kBlock, blocks[b]);
  }
  return blocks;
}

/// The colour at (u, v), pixels of the whole image, inside the roi and the mask.
std::optional<Eigen::Vector3f> colour_at(const VertexCamera& camera, float u, float v) {
  const Frame& frame = *camera.frame;
  const int x = static_cast<int>(std::floor(u + 0.5F)), y = static_cast<int>(std::floor(v + 0.5F));
  if (!frame.roi.contains(x, y) || (frame.mask && !frame.mask->get(x, y))) return std::nullopt;
  const Image& picture = camera.demosaiced ? *camera.demosaiced : frame.image;
  return sample_colour(picture.view(), u - static_cast<float>(frame.roi.x0),
                       v - static_cast<float>(frame.roi.y0));
}

/// The same, one vertex at a time through the public functions. Returns how many were seen.
int expect_sums_of_single_samples(const CameraModel& model, const VertexCamera& camera) {
  const auto screen = project_vertices(ball(), model);
  const auto normals = vertex_normals(ball());
  const auto blocks = see(camera);
  int count = 0, background_like_count = 0;
  for (size_t v = 0; v < screen.size(); ++v) {
    const ColourSums& sums = blocks[v / PointArrays::kBlock];
    const size_t i = v % PointArrays::kBlock;
    const Eigen::Vector3f& n = normals[v];
    const Eigen::Vector3f& a = camera.axis;
    const float facing = 0.0F - (n.x() * a.x() + n.y() * a.y() + n.z() * a.z());
    const auto colour = colour_at(camera, screen[v].x, screen[v].y);
    const bool seen = facing > 0 && screen[v].on_screen() && colour;
    const int x = static_cast<int>(screen[v].x + 0.5F), y = static_cast<int>(screen[v].y + 0.5F);
    const bool inner = seen && camera.mask.inner(x, y);
    const bool background_like = seen && camera.mask.background_like(x, y);
    EXPECT_EQ(sums.inner[i][3], inner ? facing : 0);
    EXPECT_EQ(sums.background_like[i][3], background_like ? facing : 0);
    EXPECT_EQ(sums.rim[i][3], seen && !inner && !background_like ? facing : 0);
    for (int k = 0; k < 3 && seen; ++k) {
      const auto& of_class = inner ? sums.inner : background_like ? sums.background_like : sums.rim;
      EXPECT_EQ(of_class[i][k], facing * (*colour)[k]) << v << " " << k;
    }
    background_like_count += background_like;
    count += seen;
  }
  EXPECT_EQ(background_like_count > 0, camera.frame->background_difference.has_value());
  return count;
}

constexpr PixelFormat kFormats[] = {PixelFormat::kBayerRG8, PixelFormat::kBayerGR8,
                                    PixelFormat::kBayerGB8, PixelFormat::kBayerBG8,
                                    PixelFormat::kRGB8,     PixelFormat::kMono8};
const Distortion kLenses[] = {{},
                              {-0.2, 0.05, 0.001, -0.002},
                              {-0.2, 0.05, 0.001, -0.002, 0.01, 0.02, 0, 0, 0.003, 0, 0, 0, 0.01}};

TEST(AccumulateVertexColours, uses_the_samples_of_sample_colour) {
  for (const PixelFormat format : kFormats) {
    for (const Distortion& lens : kLenses) {
      for (const bool with_mask : {false, true}) {
        const CameraModel model = shapes::camera({0.1, -2, 0.4}, {0, 0, 0}, kSize, 260, lens);
        const Frame frame = noise(format, with_mask);
        VertexCamera camera = prepared(model, frame);
        EXPECT_GT(expect_sums_of_single_samples(model, camera), 300) << name(format);
        camera.demosaiced = to_rgb(frame.image.view());
        EXPECT_GT(expect_sums_of_single_samples(model, camera), 300) << name(format);
      }
    }
  }
}

TEST(AccumulateVertexColours, returns_the_same_sums_on_every_instruction_set) {
  for (const Distortion& lens : kLenses) {
    const CameraModel model = shapes::camera({0.1, -2, 0.4}, {0, 0, 0}, kSize, 260, lens);
    const Frame frame = noise(PixelFormat::kBayerGB8, true);
    VertexCamera camera = prepared(model, frame);
    Mesh plate = shapes::patch(0.25F, 0.7F, 4);  // hides the upper part
    camera.depth = PointDepthBuffer(PointArrays(plate.vertices), {0, 0, 0}, 0.1, model, camera.lens,
                                    frame.roi);
    const auto best = see(camera);
    on_every_instruction_set([&] {
      const auto found = see(camera);
      for (size_t b = 0; b < best.size(); ++b) {
        EXPECT_EQ(found[b].inner, best[b].inner);
        EXPECT_EQ(found[b].rim, best[b].rim);
        EXPECT_EQ(found[b].background_like, best[b].background_like);
      }
    });
  }
}

}  // namespace
}  // namespace v3d::recon
