#include "recon/hull/slender_silhouettes.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <functional>

#include "recon/hull/intersect.h"
#include "recon/hull/volume_components.h"
#include "support/allocation_count.h"
#include "support/instruction_sets.h"
#include "tests/recon/random_rig.h"

namespace v3d::recon {
namespace {

/// A pixel of an endless plane; without foreground outside of an image.
using Pixels = std::function<bool(int x, int y)>;

bool every(const Pixels& pixels, Rect where) {
  for (int y = where.y0; y < where.y0 + where.height; ++y) {
    for (int x = where.x0; x < where.x0 + where.width; ++x) {
      if (!pixels(x, y)) return false;
    }
  }
  return true;
}

bool any(const Pixels& pixels, Rect where) {
  return !every([&](int x, int y) { return !pixels(x, y); }, where);
}

/// Values of `pixels` around the image, so that nested definitions stay affordable.
Pixels stored(ImageSize size, int margin, const Pixels& pixels) {
  const int width = size.width + 2 * margin, height = size.height + 2 * margin;
  std::vector<char> values(static_cast<size_t>(width) * height);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      values[static_cast<size_t>(y) * width + x] = pixels(x - margin, y - margin) ? 1 : 0;
    }
  }
  return [=](int x, int y) {
    x += margin;
    y += margin;
    return x >= 0 && y >= 0 && x < width && y < height &&
           values[static_cast<size_t>(y) * width + x] != 0;
  };
}

/// The definition in slender_silhouettes.h, square by square.
Mask widened_by_definition(const Mask& mask, const SlenderSizes& sizes) {
  const ImageSize size = mask.size();
  const int side = sizes.side, gap = std::max(1, sizes.gap), margin = 2 * gap;
  const Pixels foreground = [&](int x, int y) {
    return x >= 0 && y >= 0 && x < size.width && y < size.height && mask.get(x, y);
  };
  const Pixels thick_square = stored(size, side, [&](int x, int y) {
    return every(foreground, {x, y, side, side});
  });
  const Pixels slender = stored(size, margin, [&](int x, int y) {
    return foreground(x, y) && !any(thick_square, {x - side + 1, y - side + 1, side, side});
  });
  const Pixels near = stored(size, margin, [&](int x, int y) {
    return any(slender, {x, y, gap, gap});
  });
  const Pixels closed = stored(size, margin, [&](int x, int y) {
    return every(near, {x - gap + 1, y - gap + 1, gap, gap});
  });
  Mask result = mask;
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      const int r = sizes.reach;
      if (any(closed, {x - r, y - r, 2 * r + 1, 2 * r + 1})) result.set(x, y);
    }
  }
  return result;
}

/// Some rectangles, most of them slender, anywhere in and across the borders of the image.
Mask random_silhouette(ImageSize size) {
  Mask mask(size);
  for (int n = uniform_int(0, 6); n > 0; --n) {
    const int x0 = uniform_int(-5, size.width), y0 = uniform_int(-5, size.height);
    const int width = uniform_int(1, 12), height = uniform_int(1, 12);
    for (int y = std::max(0, y0); y < std::min(size.height, y0 + height); ++y) {
      mask.fill_row(y, std::clamp(x0, 0, size.width), std::clamp(x0 + width, 0, size.width));
    }
  }
  return mask;
}

ImageSize random_size() { return {uniform_int(1, 150), uniform_int(1, 30)}; }

SlenderSizes random_sizes() {
  return {.side = uniform_int(1, 8), .gap = uniform_int(0, 9), .reach = uniform_int(1, 5)};
}

RC_GTEST_PROP(SlenderSilhouettes, are_widened_as_defined, ()) {
  const SlenderSizes sizes = random_sizes();
  const ImageSize size = random_size();
  SlenderSilhouettes slender(size, sizes);
  for (int frame = 0; frame < 3; ++frame) {  // later frames use the memory of earlier ones
    const Mask mask = random_silhouette(size);
    RC_ASSERT(slender.widen(mask) == widened_by_definition(mask, sizes));
  }
}

RC_GTEST_PROP(SlenderSilhouettes, are_equal_with_every_instruction_set_of_this_processor, ()) {
  const SlenderSizes sizes = random_sizes();
  const Mask mask = random_silhouette(random_size());
  const Mask best = SlenderSilhouettes(mask.size(), sizes).widen(mask);
  on_every_instruction_set(
      [&] { RC_ASSERT(SlenderSilhouettes(mask.size(), sizes).widen(mask) == best); });
}

TEST(SlenderSilhouettes, are_joined_where_a_blade_has_a_gap) {
  Mask mask({200, 100});
  for (int y = 40; y < 44; ++y) {
    mask.fill_row(y, 20, 80);
    mask.fill_row(y, 90, 150);
  }
  SlenderSilhouettes slender(mask.size(), {.side = 6, .gap = 12, .reach = 1});
  const Mask& widened = slender.widen(mask);
  Mask expected(mask.size());
  for (int y = 39; y < 45; ++y) expected.fill_row(y, 19, 151);
  EXPECT_TRUE(widened == expected);
}

TEST(SlenderSilhouettes, leave_a_thick_part_as_it_is) {
  Mask mask({200, 100});
  for (int y = 40; y < 60; ++y) mask.fill_row(y, 50, 70);
  SlenderSilhouettes slender(mask.size(), {.side = 20, .gap = 30, .reach = 5});
  EXPECT_EQ(&slender.widen(mask), &mask);
}

TEST(SlenderSilhouettes, allocate_nothing_after_the_first_frame) {
  Mask mask({1024, 768});
  for (int y = 100; y < 700; ++y) mask.fill_row(y, y, y + 3);
  SlenderSilhouettes slender(mask.size(), {.side = 6, .gap = 18, .reach = 2});
  slender.widen(mask);
  const int64_t before = test::allocations();
  slender.widen(mask);
  EXPECT_EQ(test::allocations(), before);
}

CameraModel camera_at(double distance, double focal_px) {
  Eigen::Matrix3d k;
  k << focal_px, 0, 255.5, 0, focal_px, 191.5, 0, 0, 1;
  return {{512, 384}, k, {}, look_at({distance, 0, 1}, {0, 0, 1})};
}

TEST(SlenderSizes, follow_the_size_of_a_voxel_in_the_image) {
  const Box space{{-1, -1, 0}, {1, 1, 2}};
  // At 4 m a voxel of 1 cm has 2.5 pixels.
  EXPECT_EQ(SlenderSizes::for_camera(camera_at(4, 1000), space, 0.01),
            (SlenderSizes{.side = 5, .gap = 15, .reach = 1}));
  EXPECT_EQ(SlenderSizes::for_camera(camera_at(4, 1000), space, 0.001).reach, 0);
  EXPECT_EQ(SlenderSizes::for_camera(camera_at(0, 4000), space, 0.01), SlenderSilhouettes::kMax);
}

/// A stick of 7 mm before eight cameras; a voxel has 10 mm.
TEST(SlenderSilhouettes, give_a_hull_in_which_a_stick_thinner_than_a_voxel_is_whole) {
  const VoxelGrid grid = VoxelGrid::covering({{-1, -1, 0}, {1, 1, 2}}, 0.01);
  const Eigen::Vector3d from(-0.4, -0.2, 0.7), to(0.3, 0.25, 1.4);
  std::vector<CameraModel> cameras;
  std::vector<Mask> plain, widened;
  for (int n = 0; n < 8; ++n) {
    const double angle = 0.3 + n * 0.785;
    Eigen::Matrix3d k;
    k << 1000, 0, 511.5, 0, 1000, 383.5, 0, 0, 1;
    const Eigen::Vector3d eye(3.5 * std::cos(angle), 3.5 * std::sin(angle), n % 2 == 0 ? 2.4 : 0.3);
    cameras.emplace_back(ImageSize{1024, 768}, k, Distortion{}, look_at(eye, {0, 0, 1}));
    Mask& mask = plain.emplace_back(ImageSize{1024, 768});
    for (int i = 0; i <= 4000; ++i) {
      const auto p = cameras.back().project(from + i / 4000.0 * (to - from));
      const int x = static_cast<int>(p->x()), y = static_cast<int>(p->y());
      mask.fill_row(y, x, x + 2);
      mask.fill_row(y + 1, x, x + 2);
    }
    const SlenderSizes sizes =
        SlenderSizes::for_camera(cameras.back(), {{-1, -1, 0}, {1, 1, 2}}, grid.voxel_m);
    widened.push_back(SlenderSilhouettes(mask.size(), sizes).widen(mask));
  }
  const auto hull = [&](const std::vector<Mask>& masks) {
    std::vector<const Mask*> pointers;
    for (const Mask& mask : masks) pointers.push_back(&mask);
    return Intersector(grid, cameras, 4).intersect(pointers);
  };
  const auto components = [](const SparseVolume& volume) {
    VolumeComponents found;
    found.find(volume);
    return found.count();
  };
  EXPECT_GT(components(hull(plain)), 5U);
  EXPECT_EQ(components(hull(widened)), 1U);
}

}  // namespace
}  // namespace v3d::recon
