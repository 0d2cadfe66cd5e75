// Tests with a white ball; one camera may report background in its image.
#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "recon/shapes.h"
#include "recon/silhouettes/silhouette_repair.h"

namespace v3d::recon {
namespace {

constexpr ImageSize kSize{160, 120};
constexpr uint8_t kBall = 200;
constexpr uint8_t kWall = 90;
constexpr double kVoxel = 0.01;
/// A region inside the image of the ball, which is 80 pixels wide.
constexpr Rect kSmall{67, 47, 24, 24};
constexpr Rect kLarge{56, 36, 48, 48};

/// Three cameras side by side; the first is tested.
class Scene {
 public:
  Scene() {
    for (const double x : {0.0, -0.8, 0.8}) {
      rig_.push_back({.name = "cam" + std::to_string(rig_.size()),
                      .model = shapes::camera({x, -4, 0}, {0, 0, 0}, kSize, 320)});
      Frame frame;
      frame.camera = rig_.back().name;
      frame.sensor_size = kSize;
      frame.roi = {0, 0, kSize.width, kSize.height};
      frame.image.size = kSize;
      frame.image.bytes.assign(static_cast<size_t>(kSize.pixels()), kBall);
      frames_.push_back(std::move(frame));
    }
  }

  /// Shows the wall in the first camera's image there.
  void show_wall(const Rect& where) {
    for (int y = where.y0; y < where.y0 + where.height; ++y) {
      std::fill_n(&frames_[0].image.bytes[static_cast<size_t>(y * kSize.width + where.x0)],
                  where.width, kWall);
    }
  }

  /// Tests with the frames of this many cameras.
  ColourAgreement within(const Rect& piece, size_t cameras = 3) const {
    std::vector<const Frame*> all(frames_.size(), nullptr);
    for (size_t c = 0; c < cameras; ++c) all[c] = &frames_[c];
    Mask mask(kSize);
    for (int y = piece.y0; y < piece.y0 + piece.height; ++y) {
      mask.fill_row(y, piece.x0, piece.x0 + piece.width);
    }
    return ColourConsistency(rig_, all, 0, ball_, kVoxel).within(mask);
  }

 private:
  const Mesh ball_ = shapes::sphere({0, 0, 0}, 0.5F, 24);
  Rig rig_;
  std::vector<Frame> frames_;
};

/// The right two thirds of it.
Rect max_of(const Rect& piece) {
  const int left = piece.width / 3;
  return {piece.x0 + left, piece.y0, piece.width - left, piece.height};
}

TEST(ColourConsistency, accepts_regions_with_the_colours_of_neighbouring_cameras) {
  const ColourAgreement all = Scene().within(kSmall);
  EXPECT_EQ(all.compared, 64);
  EXPECT_EQ(all.agreeing, 64);
  EXPECT_TRUE(all.is_consistent());
}

TEST(ColourConsistency, rejects_regions_that_show_the_wall_behind) {
  Scene scene;
  scene.show_wall(kSmall);
  const ColourAgreement none = scene.within(kSmall);
  EXPECT_EQ(none.compared, 64);
  EXPECT_LT(none.agreeing, 3);
  EXPECT_FALSE(none.is_consistent());
}

TEST(ColourConsistency, requires_more_than_a_third_of_a_small_piece_but_not_of_a_large_one) {
  Scene scene;
  scene.show_wall(max_of(kSmall));
  EXPECT_FALSE(scene.within(kSmall).is_consistent());
  Scene other;
  other.show_wall(max_of(kLarge));
  EXPECT_TRUE(other.within(kLarge).is_consistent());
}

TEST(ColourConsistency, compares_nothing_without_colours_or_points) {
  const Scene scene;
  EXPECT_EQ(scene.within(kSmall, 0).compared, 0);
  EXPECT_EQ(scene.within(kSmall, 2).compared, 0) << "one other camera is no agreement";
  EXPECT_FALSE(scene.within(kSmall, 2).is_consistent());
  EXPECT_EQ(scene.within({2, 2, 20, 20}).compared, 0) << "beside the ball";
  EXPECT_FALSE(scene.within({79, 59, 9, 9}).is_consistent()) << "nine points";
}

}  // namespace
}  // namespace v3d::recon
