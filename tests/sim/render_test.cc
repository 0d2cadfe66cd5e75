#include <gtest/gtest.h>

#include <cmath>

#include "base/image/colour.h"
#include "sim/performer/motion.h"
#include "sim/rendering/camera_images.h"
#include "sim/rendering/scene.h"

namespace v3d::sim {
namespace {

const ImageSize kSize{512, 384};

RenderOptions noiseless() {
  RenderOptions options;
  options.noise = 0;
  return options;
}

Mask dilated(const Mask& mask, int radius) {
  Mask out(mask.size());
  for (int y = 0; y < mask.size().height; ++y) {
    for (int x = 0; x < mask.size().width; ++x) {
      if (!mask.get(x, y)) continue;
      const int x0 = std::max(0, x - radius), x1 = std::min(mask.size().width, x + radius + 1);
      for (int j = std::max(0, y - radius); j < std::min(mask.size().height, y + radius + 1); ++j) {
        out.fill_row(j, x0, x1);
      }
    }
  }
  return out;
}

/// Pixels that the performer changed, in RGB renderings of one view. Shadow pixels are excluded: a
/// shadow scales all channels by the same factor, at least 0.5.
Mask changed(const Image& plate, const Image& image) {
  Mask mask(plate.size);
  for (int y = 0; y < plate.size.height; ++y) {
    for (int x = 0; x < plate.size.width; ++x) {
      double ratio[3];
      int largest = 0;
      for (int c = 0; c < 3; ++c) {
        const double before = plate.row(y)[3 * x + c];
        const double after = image.row(y)[3 * x + c];
        ratio[c] = (after + 1) / (before + 1);
        largest = std::max(largest, static_cast<int>(std::abs(after - before)));
      }
      const auto [low, high] = std::minmax({ratio[0], ratio[1], ratio[2]});
      const bool shadow = low > 0.45 && high < 1.03 && high / low < 1.06;
      if (largest > 2 && !shadow) mask.set(x, y);
    }
  }
  return mask;
}

int64_t outside(const Mask& inner, const Mask& outer) {
  int64_t count = 0;
  for (int y = 0; y < inner.size().height; ++y) {
    for (int x = 0; x < inner.size().width; ++x) count += inner.get(x, y) && !outer.get(x, y);
  }
  return count;
}

TEST(Render, gives_the_same_bytes_twice) {
  const Rig rig = make_rig(4, kSize, 3);
  for (const RigCamera& camera : rig) {
    const RenderOptions options;
    const Image once = render(camera, 1.2, true, 9, options);
    EXPECT_EQ(once.bytes, render(camera, 1.2, true, 9, options).bytes);
    EXPECT_NE(once.bytes, render(camera, 1.2, true, 10, options).bytes);
  }
}

TEST(Render, gives_the_same_bytes_in_a_batch_and_alone) {
  const Rig rig = make_rig(5, {160, 120}, 3);
  const RenderOptions options;
  const std::vector<Image> together = BatchRenderer(rig, options).render_all(0.7, 4);
  ASSERT_EQ(together.size(), rig.size());
  for (size_t i = 0; i < rig.size(); ++i) {
    EXPECT_EQ(together[i].bytes, render(rig[i], 0.7, true, 4, options).bytes);
  }
}

TEST(Render, changes_the_background_only_in_the_true_silhouette) {
  const Rig rig = make_rig(8, kSize, 2);
  RenderOptions options = noiseless();
  options.format = PixelFormat::kRGB8;
  options.exposure_s = 0;
  for (const size_t c : {0U, 1U, 2U, 3U, 7U}) {
    const Image plate = render(rig[c], 0, false, 0, options);
    for (const double t : {0.0, 1.0, 1.3, 3.0}) {
      const Mask difference = changed(plate, render(rig[c], t, true, 0, options));
      const Mask truth = true_silhouette(rig[c], t, options.seed);
      ASSERT_GT(truth.count(), 2000) << rig[c].name;
      EXPECT_EQ(outside(difference, dilated(truth, 1)), 0) << rig[c].name << " at " << t;
      // The difference may have small holes where the performer has the colour of the room.
      EXPECT_EQ(outside(truth, dilated(difference, 2)), 0) << rig[c].name << " at " << t;
      EXPECT_GT(intersection_over_union(difference, truth), 0.99) << rig[c].name << " at " << t;
    }
  }
}

TEST(Render, has_a_true_silhouette_that_contains_every_surface_point) {
  const RigCamera camera = make_rig(4, kSize, 1)[2];
  const Mask near = dilated(true_silhouette(camera, 0.4, 1), 1);
  for (const auto& v : performer_at(0.4, 1).vertices) {
    const auto pixel = camera.model.project(v.cast<double>());
    ASSERT_TRUE(pixel);
    EXPECT_TRUE(near.get(static_cast<int>(std::floor(pixel->x() + 0.5)),
                         static_cast<int>(std::floor(pixel->y() + 0.5))));
  }
}

TEST(Render, adds_noise_of_the_given_standard_deviation) {
  const RigCamera camera = make_rig(4, kSize, 1)[0];
  RenderOptions options = noiseless();
  const Image clean = render(camera, 0, false, 0, options);
  options.noise = 3;
  const Image noisy = render(camera, 0, false, 0, options);
  double sum = 0, squares = 0;
  int64_t count = 0;
  for (size_t i = 0; i < clean.bytes.size(); ++i) {
    if (clean.bytes[i] < 20 || clean.bytes[i] > 235) continue;  // clipped tails
    const double d = noisy.bytes[i] - clean.bytes[i];
    sum += d;
    squares += d * d;
    ++count;
  }
  const auto n = static_cast<double>(count);
  EXPECT_NEAR(sum / n, 0, 0.05);
  EXPECT_NEAR(std::sqrt(squares / n), 3, 0.1);
}

TEST(Render, has_equal_colours_in_all_pixel_formats) {
  const RigCamera camera = make_rig(4, {64, 48}, 1)[0];
  RenderOptions options = noiseless();
  options.format = PixelFormat::kRGB8;
  const Image rgb = render(camera, 0.3, true, 0, options);
  for (const PixelFormat format : {PixelFormat::kBayerRG8, PixelFormat::kBayerGR8,
                                   PixelFormat::kBayerGB8, PixelFormat::kBayerBG8}) {
    options.format = format;
    const Image bayer = render(camera, 0.3, true, 0, options);
    ASSERT_EQ(bayer.bytes, mosaic(rgb.view(), format).bytes);
  }
  options.format = PixelFormat::kMono8;
  EXPECT_EQ(render(camera, 0.3, true, 0, options).bytes.size(), 64U * 48U);
}

TEST(Render, has_motion_blur_of_the_blade) {
  // From the side of the cut (camera 4 of 15 stands at 72 to 96 degrees), the moving blade is wider
  // and paler than a frozen one. At rest both are equal.
  const RigCamera camera = make_rig(15, {1024, 768}, 1)[4];
  const auto differing = [&](double t) {
    RenderOptions options = noiseless();
    const Image blurred = render(camera, t, true, 0, options);
    options.exposure_s = 0;
    const Image frozen = render(camera, t, true, 0, options);
    int64_t count = 0;
    for (size_t i = 0; i < frozen.bytes.size(); ++i) {
      count += std::abs(blurred.bytes[i] - frozen.bytes[i]) > 8;
    }
    return count;
  };
  EXPECT_GT(differing(1.26), 300);
  EXPECT_LT(differing(0.0), 60);
}

TEST(Render, has_a_soft_shadow_on_the_floor_only) {
  const RigCamera camera = make_rig(15, kSize, 1)[1];
  RenderOptions options = noiseless();
  options.format = PixelFormat::kRGB8;
  const Image plate = render(camera, 0, false, 0, options);
  const Image image = render(camera, 0, true, 0, options);
  const Mask body = dilated(true_silhouette(camera, 0, 1), 2);
  int64_t darker = 0;
  for (int y = 0; y < kSize.height; ++y) {
    for (int x = 0; x < kSize.width; ++x) {
      if (body.get(x, y)) continue;
      for (int c = 0; c < 3; ++c) {
        const int before = plate.row(y)[3 * x + c], after = image.row(y)[3 * x + c];
        ASSERT_LE(after, before);
        ASSERT_GE(after + 1, before / 2);  // the segmentation may classify it as shadow
        darker += after < before - 3;
      }
    }
  }
  EXPECT_GT(darker, 200);
}

}  // namespace
}  // namespace v3d::sim
