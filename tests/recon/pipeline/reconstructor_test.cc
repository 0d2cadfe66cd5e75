#include "recon/pipeline/reconstructor.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>

#include "base/core/error.h"
#include "base/image/colour.h"
#include "recon/mesh/self_intersection.h"
#include "recon/metrics/evaluation.h"
#include "recon/pipeline/compact_frame.h"
#include "recon/pipeline/frame_set.h"
#include "recon/render/renderer.h"
#include "recon/shapes.h"
#include "recon/volumes.h"
#include "support/message_of.h"

namespace v3d::recon {
namespace {

using testing::ElementsAre;

constexpr ImageSize kSize{240, 180};

/// A ball that is red towards +x and blue towards -x.
Mesh two_coloured_ball() {
  Mesh ball = shapes::sphere({0, 0, 1}, 0.4F, 48);
  for (const Eigen::Vector3f& v : ball.vertices) {
    ball.colours.push_back(v.x() > 0 ? Rgb8{220, 30, 20} : Rgb8{20, 40, 210});
  }
  return ball;
}

Rig ring(int count) {
  Rig rig;
  for (int i = 0; i < count; ++i) {
    const double angle = 2 * std::numbers::pi * i / count;
    rig.push_back({"cam" + std::to_string(i),
                   shapes::camera({2 * std::cos(angle), 2 * std::sin(angle), 1 + 0.8 * (i % 3)},
                                  {0, 0, 1}, kSize, 230, {-0.1, 0.02})});
  }
  return rig;
}

FrameSet photograph(const Mesh& mesh, const Rig& rig) {
  FrameSet set;
  set.pulse = 12;
  FrameLabel label;
  label.pulse = 12;
  for (const RigCamera& camera : rig) {
    const Image raw = mosaic(draw_mesh(mesh, camera.model).view(), PixelFormat::kBayerRG8);
    set.frames.push_back(
        observe(camera.name, label, raw.view(), draw_silhouette(mesh, camera.model)));
  }
  return set;
}

ReconstructOptions options() {
  return {.bounds = {{-0.6, -0.6, 0.4}, {0.6, 0.6, 1.6}}, .voxel_m = 0.02, .min_views = 3};
}

TEST(Reconstructor, reconstructs_a_coloured_ball_from_its_images) {
  const Mesh ball = two_coloured_ball();
  const Rig rig = ring(12);
  Reconstructor reconstructor(rig, options());
  const Reconstruction result = reconstructor.reconstruct(photograph(ball, rig));

  EXPECT_EQ(result.pulse, 12);
  EXPECT_NEAR(result.volume_m3, enclosed_volume(ball), 0.05 * enclosed_volume(ball));
  EXPECT_TRUE(is_watertight(result.mesh));
  EXPECT_EQ(connected_components(result.mesh), 1);
  const SurfaceDistance distance = compare_surfaces(result.mesh, ball);
  EXPECT_LT(distance.accuracy_p90_mm, 20);
  EXPECT_LT(distance.completeness_p90_mm, 20);

  ASSERT_EQ(result.mesh.colours.size(), result.mesh.vertices.size());
  for (size_t v = 0; v < result.mesh.vertices.size(); ++v) {
    const Rgb8 c = result.mesh.colours[v];
    if (result.mesh.vertices[v].z() < 0.75F) {
      continue;  // no camera looks up: below, only rims of silhouettes are visible
    }
    if (result.mesh.vertices[v].x() > 0.1F) {
      EXPECT_TRUE(c.r > 180 && c.b < 60) << result.mesh.vertices[v].transpose();
    } else if (result.mesh.vertices[v].x() < -0.1F) {
      EXPECT_TRUE(c.r < 60 && c.b > 170) << result.mesh.vertices[v].transpose();
    }
  }
  EXPECT_GE(result.times.intersect, 0);
  EXPECT_GE(result.times.encode, 0);
  EXPECT_LT(result.times.deform, 0);  // did not run
}

TEST(Reconstructor, corrects_the_colours_of_cameras_by_their_responses) {
  const Mesh ball = two_coloured_ball();
  Rig rig = ring(12);
  FrameSet set = photograph(ball, rig);
  const Reconstruction equal_cameras = Reconstructor(rig, options()).reconstruct(set);
  for (size_t c = 0; c < rig.size(); c += 2) {
    for (uint8_t& grey : set.frames[c].image.bytes) grey /= 2;
    rig[c].colour.matrix *= 2;
  }
  const Reconstruction corrected = Reconstructor(rig, options()).reconstruct(set);
  ASSERT_EQ(corrected.mesh.vertices, equal_cameras.mesh.vertices);
  ASSERT_EQ(corrected.mesh.colours.size(), equal_cameras.mesh.colours.size());
  double difference = 0;  // grey values, of three channels
  for (size_t v = 0; v < corrected.mesh.colours.size(); ++v) {
    const Rgb8 a = corrected.mesh.colours[v], b = equal_cameras.mesh.colours[v];
    difference += std::abs(a.r - b.r) + std::abs(a.g - b.g) + std::abs(a.b - b.b);
  }
  EXPECT_LT(difference / (3 * static_cast<double>(corrected.mesh.colours.size())), 2)
      << "halved images lose a bit, and the mesh has rounded colours";
}

TEST(Reconstructor, returns_the_mesh_that_receivers_decode) {
  const Rig rig = ring(8);
  Reconstructor reconstructor(rig, options());
  const Reconstruction result = reconstructor.reconstruct(photograph(two_coloured_ball(), rig));
  const auto decoded = decode_compact(result.compact);
  ASSERT_TRUE(decoded);
  EXPECT_EQ(decoded->mesh.vertices, result.mesh.vertices);
  EXPECT_EQ(decoded->mesh.triangles, result.mesh.triangles);
  EXPECT_EQ(decoded->mesh.colours, result.mesh.colours);
  EXPECT_EQ(decoded->cameras, result.cameras);
  EXPECT_EQ(decoded->pulse, 12);
  EXPECT_EQ(decoded->quality, static_cast<float>(result.quality.silhouette_iou));
}

/// The compact frame that the stages make, without Reconstructor.
std::vector<uint8_t> by_stages(const Rig& rig, const FrameSet& set, Quality quality) {
  const ReconstructOptions given = options();
  const RigFrames frames = usable_frames(rig, set);
  HullStage hulls(rig, given.bounds, given.voxel_m, given.min_views);
  Hull hull = hulls.intersect(frames);
  Mesh mesh = hulls.surface(hull.volume);
  std::optional<VertexLattice> lattice;
  int live_passes = 0;
  if (quality == Quality::kHigh) {
    DeformStage deform(rig, hulls.grid(), given.deform);
    deform.deform(frames, hull.volume, mesh);
    lattice = deform.lattice();
  }
  if (quality == Quality::kMedium) {
    LiveDeformStage deform(rig, hulls.grid());
    deform.deform(frames, kDefaultLivePasses, mesh);
    lattice = deform.lattice();
    live_passes = kDefaultLivePasses;
  }
  colour_surface(rig, frames, given.voxel_m,
                 quality == Quality::kHigh ? ColourDetail::kFull : ColourDetail::kLive, mesh);
  const QualityMeter meter(rig, given.bounds, given.voxel_m);
  PulseMetadata metadata{
      .pulse = set.pulse, .exposure = set.exposure, .cameras = names_of(rig, frames)};
  metadata.missing = static_cast<int>(rig.size() - metadata.cameras.size());
  metadata.quality = meter.measure(mesh, frames).silhouette_iou;
  metadata.live_passes = live_passes;
  return EncodeStage(hulls.grid(), lattice).encode(metadata, hull.volume, mesh);
}

TEST(Stages, name_what_is_wrong_in_the_metadata_of_a_small_surface) {
  const SparseVolume volume = make_volume(
      small_grid(8, 8, 8), [](int i, int j, int k) { return i == 4 && j == 4 && k == 4; });
  PulseMetadata metadata;
  metadata.pulse = 3;
  const auto error = [&] {
    Mesh mesh = marching_cubes(volume);
    EncodeStage stage(volume.grid(), std::nullopt);
    return test::message_of<InputError>([&] { stage.encode(metadata, volume, mesh); });
  };
  metadata.cameras = {"b", "a"};
  EXPECT_EQ(error(), "pulse 3: cameras: expected names in ascending order, each once");
  metadata.cameras = {"a", "b"};
  metadata.quality = 95;
  EXPECT_EQ(error(), "pulse 3: quality: expected 0 to 1");
  metadata.quality = 0.95;
  const std::vector<uint8_t> performers(2, 1);
  metadata.performers = performers;
  EXPECT_EQ(error(), "pulse 3: performers: expected one for each of 6 vertices, found 2");
}

TEST(Stages, one_after_the_other_make_the_compact_frame_of_the_reconstructor) {
  const Rig rig = ring(8);
  FrameSet set = photograph(two_coloured_ball(), rig);
  set.frames.pop_back();  // one camera did not deliver
  for (const Quality quality : {Quality::kLive, Quality::kMedium, Quality::kHigh}) {
    ReconstructOptions chosen = options();
    chosen.quality = quality;
    Reconstructor reconstructor(rig, chosen);
    EXPECT_EQ(by_stages(rig, set, quality), reconstructor.reconstruct(set).compact);
  }
}

TEST(Stages, ignore_frames_of_unknown_cameras_and_of_other_sizes) {
  const Rig rig = ring(4);
  FrameSet set = photograph(two_coloured_ball(), rig);
  set.frames[0].camera = "cam9";
  set.frames[1].mask = Mask({10, 10});
  const RigFrames frames = usable_frames(rig, set);
  EXPECT_THAT(frames, ElementsAre(nullptr, nullptr, &set.frames[2], &set.frames[3]));
  EXPECT_THAT(names_of(rig, frames), ElementsAre("cam2", "cam3"));
}

/// The compact frames of pulses 24 to 26 of a still scene, made in the two stages.
std::vector<Reconstruction> stages_of_a_still(const Rig& rig, bool begin_anew) {
  Reconstructor reconstructor(rig, options());
  std::vector<Reconstruction> results;
  for (int64_t pulse = 23; pulse < 27; ++pulse) {
    FrameSetJob work(photograph(two_coloured_ball(), rig));
    work.set.pulse = pulse;
    reconstructor.make_mesh(work);
    reconstructor.encode(work);
    if (begin_anew) reconstructor.begin_sequence();
    results.push_back(std::move(work.result));
  }
  return results;
}

TEST(Reconstructor, encodes_one_sequence_with_key_frames_at_fixed_pulses) {
  const Rig rig = ring(8);
  const auto sequence = stages_of_a_still(rig, false);
  CompactDecoder decoder;
  for (const Reconstruction& result : sequence) {
    EXPECT_EQ(decode_compact(result.compact).has_value(), result.pulse == 23 || result.pulse == 25);
    ASSERT_EQ(decoder.decode(result.compact), codec::DecodeStatus::kOk);
    EXPECT_EQ(decoder.frame().mesh.vertices, result.mesh.vertices);
    EXPECT_EQ(decoder.frame().mesh.colours, result.mesh.colours);
  }
  EXPECT_LT(sequence[1].compact.size(), sequence[0].compact.size());
  for (const Reconstruction& result : stages_of_a_still(rig, true)) {
    EXPECT_TRUE(decode_compact(result.compact)) << result.pulse;
  }
}

TEST(Reconstructor, returns_the_same_bytes_for_any_threads_and_any_order_of_frames) {
  const Rig rig = ring(9);
  FrameSet set = photograph(two_coloured_ball(), rig);
  ReconstructOptions opts = options();
  const auto expected = Reconstructor(rig, opts).reconstruct(set).compact;
  for (const int threads : {1, 2, 5}) {
    opts.threads = threads;
    std::rotate(set.frames.begin(), set.frames.begin() + 2, set.frames.end());
    std::swap(set.frames[0], set.frames[5]);
    EXPECT_EQ(Reconstructor(rig, opts).reconstruct(set).compact, expected);
  }
}

TEST(Reconstructor, of_high_quality_returns_the_same_bytes_for_any_threads) {
  const Rig rig = ring(9);
  const FrameSet set = photograph(two_coloured_ball(), rig);
  ReconstructOptions opts = options();
  opts.quality = Quality::kHigh;
  const Reconstruction expected = Reconstructor(rig, opts).reconstruct(set);
  EXPECT_GE(expected.times.deform, 0);
  const auto decoded = decode_compact(expected.compact);
  EXPECT_EQ(decoded->mesh.vertices, expected.mesh.vertices);
  EXPECT_DOUBLE_EQ(decoded->lattice.step, opts.voxel_m / 50);
  EXPECT_LT(compare_surfaces(expected.mesh, two_coloured_ball()).normal_error_deg, 15);
  EXPECT_TRUE(self_intersections(expected.mesh).empty());
  for (const int threads : {1, 2, 5}) {
    opts.threads = threads;
    EXPECT_EQ(Reconstructor(rig, opts).reconstruct(set).compact, expected.compact);
  }
}

Reconstruction medium_with(int passes, int threads, const FrameSet& set) {
  ReconstructOptions opts = options();
  opts.quality = Quality::kMedium;
  opts.live_passes = passes;
  opts.threads = threads;
  return Reconstructor(ring(9), opts).reconstruct(set);
}

TEST(Reconstructor, of_medium_quality_returns_the_same_bytes_for_the_same_passes) {
  const FrameSet set = photograph(two_coloured_ball(), ring(9));
  for (int passes = 0; passes <= kLivePasses; ++passes) {
    const Reconstruction expected = medium_with(passes, 1, set);
    EXPECT_EQ(decode_compact(expected.compact)->mesh.vertices, expected.mesh.vertices);
    EXPECT_EQ(medium_with(passes, 4, set).compact, expected.compact) << passes << " passes";
    EXPECT_EQ(decode_compact(expected.compact)->live_passes, passes);
  }
  EXPECT_NE(medium_with(0, 1, set).compact, medium_with(1, 1, set).compact);
}

TEST(Reconstructor, states_the_passes_before_a_stop_and_repeats_them_to_the_same_bytes) {
  const FrameSet set = photograph(two_coloured_ball(), ring(9));
  ReconstructOptions opts = options();
  opts.quality = Quality::kMedium;
  for (int allowed = 0; allowed <= kLivePasses; ++allowed) {
    Reconstructor reconstructor(ring(9), opts);
    FrameSetJob work(set);
    work.live_passes = kLivePasses;
    int asked = 0;
    work.may_run_pass = [&] { return asked++ < allowed; };
    reconstructor.make_mesh(work);
    reconstructor.encode(work);
    EXPECT_EQ(work.result.live_passes, allowed);
    EXPECT_EQ(asked, std::min(allowed + 1, kLivePasses)) << "once before each pass";
    EXPECT_EQ(decode_compact(work.result.compact)->live_passes, allowed);
    EXPECT_EQ(work.result.compact, medium_with(allowed, 1, set).compact) << allowed << " passes";
  }
}

TEST(Reconstructor, is_independent_of_the_previous_set) {
  const Rig rig = ring(9);
  const FrameSet ball = photograph(two_coloured_ball(), rig);
  const FrameSet cube = photograph(shapes::box({-0.3F, -0.2F, 0.7F}, {0.3F, 0.2F, 1.2F}), rig);
  Reconstructor reconstructor(rig, options());
  const auto first = reconstructor.reconstruct(ball).compact;
  reconstructor.reconstruct(cube);
  EXPECT_EQ(reconstructor.reconstruct(ball).compact, first);
}

TEST(Reconstructor, omits_unusable_frames_and_reports_the_used_cameras) {
  const Rig rig = ring(8);
  FrameSet set = photograph(two_coloured_ball(), rig);
  set.frames[1].camera = "stranger";
  set.frames[2].mask = Mask({10, 10});
  set.frames[3].mask.reset();
  set.frames[4].image = Image({4, 4}, PixelFormat::kMono8);
  set.frames.erase(set.frames.begin() + 5);
  const Reconstruction result = Reconstructor(rig, options()).reconstruct(set);
  EXPECT_THAT(result.cameras, ElementsAre("cam0", "cam6", "cam7"));
  EXPECT_EQ(decode_compact(result.compact)->missing, 5);
}

TEST(WarmUp, is_a_ball_in_the_middle_of_the_space) {
  const Rig rig = ring(8);
  const Reconstruction result =
      Reconstructor(rig, options()).reconstruct(warm_up_frame_set(rig, options().bounds));
  EXPECT_EQ(result.cameras.size(), rig.size());
  const double ball = 4.0 / 3 * std::numbers::pi * std::pow(0.3, 3);
  EXPECT_NEAR(result.volume_m3, ball, 0.2 * ball);
}

TEST(Reconstructor, returns_an_empty_mesh_without_frames) {
  const Reconstruction result =
      Reconstructor(ring(4), options()).reconstruct({.pulse = 3, .frames = {}});
  EXPECT_TRUE(result.mesh.vertices.empty());
  EXPECT_EQ(result.volume_m3, 0);
  EXPECT_EQ(decode_compact(result.compact)->missing, 4);
}

std::string refusal(const Rig& rig, const ReconstructOptions& opts) {
  try {
    Reconstructor reconstructor(rig, opts);
  } catch (const InputError& error) {
    return error.what();
  }
  return {};
}

TEST(Reconstructor, rejects_impossible_options) {
  ReconstructOptions even = options(), tiny = options();
  even.quality = Quality::kHigh;
  even.deform.window = 4;
  EXPECT_EQ(refusal(ring(4), even), "deform: window: want an odd number of samples from 3 to 11");
  ReconstructOptions many = options();
  many.quality = Quality::kMedium;
  many.live_passes = kLivePasses + 1;
  EXPECT_EQ(refusal(ring(4), many), "live passes: expected 0 to 3, found 4");
  tiny.voxel_m = 1e-5;
  EXPECT_THAT(refusal(ring(4), tiny), testing::HasSubstr("voxels"));
}

}  // namespace
}  // namespace v3d::recon
