#include <gtest/gtest.h>

#include "recon/render/renderer.h"
#include "recon/shapes.h"
#include "recon/surface/concavity_carving.h"
#include "recon/volumes.h"

namespace v3d::recon {
namespace {

constexpr ImageSize kSize{160, 120};

/// A camera with the silhouette of a box, and the depths of other surfaces.
struct View {
  CameraModel model = shapes::camera({2, 0.3, 1.2}, {0, 0, 1}, kSize, 300, {-0.1, 0.02});
  Frame frame;
  std::vector<SurfaceCamera> cameras;

  View() {
    const Mask silhouette = draw_silhouette(whole(), model);
    frame = observe("cam", {}, Image(kSize, PixelFormat::kMono8).view(), silhouette);
    cameras.emplace_back(DeformCamera{&model, &frame});
  }
  static Mesh whole() { return shapes::box({-0.2F, -0.3F, 0.8F}, {0.2F, 0.3F, 1.2F}); }
  Mask open_without(const Mesh& after) const {
    return uncovered_pixels(covered_pixels(cameras[0], draw_depth(whole(), model)),
                            draw_depth(after, model));
  }
};

TEST(UncoveredPixels, is_the_newly_uncovered_foreground_and_one_pixel_around) {
  const View view;
  Mesh parts = shapes::box({-0.2F, -0.3F, 0.8F}, {0.2F, -0.1F, 1.2F});
  shapes::append(parts, shapes::box({-0.2F, 0.1F, 0.8F}, {0.2F, 0.3F, 1.2F}));
  const Mask open = view.open_without(parts), covered = draw_silhouette(parts, view.model);
  int gap = 0, missed = 0;
  for (int y = 0; y < kSize.height; ++y) {
    for (int x = 0; x < kSize.width; ++x) {
      if (!view.frame.mask->get(x, y) || covered.get(x, y)) continue;
      ++gap;
      missed += !open.get(x, y);
    }
  }
  EXPECT_GT(gap, 300);
  EXPECT_LE(missed, 4) << "its corners";
  EXPECT_LT(open.count(), 1.5 * gap);
}

TEST(UncoveredPixels, omits_rims_of_one_or_two_pixels) {
  const View view;
  EXPECT_EQ(view.open_without(View::whole()).count(), 0);
  // A pixel is 6.8 mm there.
  EXPECT_EQ(view.open_without(shapes::box({-0.2F, -0.29F, 0.81F}, {0.2F, 0.29F, 1.19F})).count(),
            0);
  EXPECT_GT(view.open_without(shapes::box({-0.2F, -0.27F, 0.8F}, {0.2F, 0.3F, 1.2F})).count(), 0);
}

TEST(UncoveredPixels, is_empty_where_the_camera_sees_background) {
  View view;
  view.frame.mask = Mask(kSize);
  EXPECT_EQ(view.open_without(Mesh{}).count(), 0);
}

TEST(VoxelsAt, are_those_whose_centres_fall_on_the_pixels) {
  const View view;
  const VoxelGrid grid{Eigen::Vector3d(-0.2, -0.3, 0.8), 0.02, {20, 30, 20}};
  const SparseVolume volume = make_volume(grid, [](int i, int, int) { return i != 7; });
  const std::vector<codec::Brick> all(volume.bricks().begin(), volume.bricks().end());
  Mask pixels(kSize);
  for (int y = 40; y < 60; ++y) pixels.fill_row(y, 70, 83);
  const std::vector<codec::Brick> found =
      voxels_at(std::span(&pixels, 1), view.cameras, volume, all);
  const auto expected = make_volume(grid, [&](int i, int j, int k) {
    if (!volume.get(i, j, k)) return false;
    const auto seen = view.cameras[0].project(grid.center(i, j, k).cast<float>());
    return seen && pixels.get(static_cast<int>(seen->pixel.x()), static_cast<int>(seen->pixel.y()));
  });
  ASSERT_GT(expected.count(), 100);
  int64_t count = 0;
  for (size_t b = 0; b < found.size(); ++b) {
    const int there = expected.index_of(volume.coords()[b]);
    EXPECT_EQ(found[b], there < 0 ? codec::kEmptyBrick : expected.bricks()[there]);
    for (const uint64_t layer : found[b]) count += codec::bit_count(layer);
  }
  EXPECT_EQ(count, expected.count());
}

TEST(VoxelsAt, are_none_without_pixels_and_only_requested_ones) {
  const View view;
  const SparseVolume volume = make_volume({Eigen::Vector3d(-0.2, -0.3, 0.8), 0.02, {20, 30, 20}},
                                          [](int, int, int) { return true; });
  const std::vector<codec::Brick> all(volume.bricks().begin(), volume.bricks().end());
  const std::vector<codec::Brick> none(all.size(), codec::kEmptyBrick);
  const Mask dark(kSize);
  EXPECT_EQ(voxels_at(std::span(&dark, 1), view.cameras, volume, all), none);
  Mask bright(kSize);
  for (int y = 0; y < kSize.height; ++y) bright.fill_row(y, 0, kSize.width);
  EXPECT_EQ(voxels_at(std::span(&bright, 1), view.cameras, volume, all), all);
  EXPECT_EQ(voxels_at(std::span(&bright, 1), view.cameras, volume, none), none);
}

}  // namespace
}  // namespace v3d::recon
