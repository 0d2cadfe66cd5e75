#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "recon/surface/template_windows.h"
#include "support/instruction_sets.h"

namespace v3d::recon {
namespace {

constexpr ImageSize kSize{160, 120};

/// A picture of noise, all foreground, moved to the right by `shift` pixels.
Frame noise(int shift, int gain = 1) {
  Image image(kSize, PixelFormat::kMono8);
  for (int y = 0; y < kSize.height; ++y) {
    for (int x = 0; x < kSize.width; ++x) {
      std::mt19937 random(static_cast<unsigned>(1000 * y + x - shift + 500));
      image.row(y)[x] = static_cast<uint8_t>(gain * (20 + random() % 80));
    }
  }
  Mask mask(kSize);
  for (int y = 0; y < kSize.height; ++y) mask.fill_row(y, 0, kSize.width);
  return observe("cam", {}, image.view(), mask);
}

/// A window that moves along x by a pixel a step.
WindowView window_at(const Luminance& image, float x, float y, float pixels_per_step) {
  return {
      &image, x + 0.5F - image.first_u(), y + 0.5F - image.first_v(), 1, 0, 0, 1, pixels_per_step,
      0};
}

DepthProfile profile_of(const WindowViews& views, const CorrelationOptions& options = {}) {
  DepthProfile profile{};
  correlate(views, options, profile);
  return profile;
}

TEST(Correlation, is_one_at_the_depth_where_the_pictures_agree) {
  const Luminance reference(noise(0)), shifted(noise(3));
  WindowViews views;
  views.count = 2;
  views.view = {window_at(reference, 80, 60, 0), window_at(shifted, 80, 60, 1)};
  const DepthProfile profile = profile_of(views);
  const auto best = std::max_element(profile.begin(), profile.end()) - profile.begin();
  EXPECT_EQ(best - 8, 3);  // steps out
  EXPECT_GT(profile[11], 0.98F);
  EXPECT_LT(profile[9], 0.7F);
}

double sample(const Luminance& image, double u, double v) {
  const int x = static_cast<int>(u), y = static_cast<int>(v);
  const uint32_t quad = image.quads()[y * image.width() + x];
  const auto byte = [&](int k) { return static_cast<double>(quad >> 8 * k & 255); };
  const double upper = std::lerp(byte(0), byte(1), u - x),
               lower = std::lerp(byte(2), byte(3), u - x);
  return std::lerp(upper, lower, v - y);
}

/// Equation (5), with `noise` added to both variances.
double plain_correlation(const WindowView& a, const WindowView& b, double depth, int side,
                         double noise) {
  const int half = side / 2, count = side * side;
  double sum_a = 0, sum_b = 0, aa = 0, bb = 0, ab = 0;
  for (int j = -half; j <= half; ++j) {
    for (int i = -half; i <= half; ++i) {
      const auto of = [&](const WindowView& view) {
        return sample(*view.image,
                      view.u + i * view.u_across + j * view.u_down + depth * view.u_out,
                      view.v + i * view.v_across + j * view.v_down + depth * view.v_out);
      };
      const double in_a = of(a), in_b = of(b);
      sum_a += in_a, sum_b += in_b;
      aa += in_a * in_a, bb += in_b * in_b, ab += in_a * in_b;
    }
  }
  const auto variance = [&](double squares, double sum) {
    return squares - sum * sum / count + count * noise;
  };
  return (ab - sum_a * sum_b / count) / std::sqrt(variance(aa, sum_a) * variance(bb, sum_b));
}

TEST(Correlation, equals_equation_5_for_any_position_and_window_size) {
  const Luminance one(noise(0)), other(noise(3));
  std::mt19937 random(11);
  const auto between = [&](float low, float high) {
    return std::uniform_real_distribution<float>(low, high)(random);
  };
  for (const int side : {3, 5, 7, 9, kMaxWindowSide}) {
    const CorrelationOptions options{.side = side, .noise = 2, .robust = false};
    for (int i = 0; i < 20; ++i) {
      WindowViews views;
      views.count = 2;
      for (WindowView* view : {&views.view[0], &views.view[1]}) {
        *view = window_at(view == &views.view[0] ? one : other, between(60, 90), between(50, 70),
                          between(-1, 1));
        view->u_across = between(-1.5F, 1.5F), view->v_across = between(-1.5F, 1.5F);
        view->u_down = between(-1.5F, 1.5F), view->v_down = between(-1.5F, 1.5F);
        view->v_out = between(-1, 1);
      }
      const DepthProfile profile = profile_of(views, options);
      for (int k = 0; k < kDepthSteps; ++k) {
        EXPECT_NEAR(profile[k],
                    plain_correlation(views.view[0], views.view[1], options.first + k, side, 2),
                    0.02);
      }
    }
  }
}

TEST(Correlation, is_invariant_to_brightness_and_contrast) {
  const Luminance reference(noise(0)), brighter(noise(0, 2));
  WindowViews views;
  views.count = 2;
  views.view = {window_at(reference, 80, 60, 0), window_at(brighter, 80, 60, 1)};
  EXPECT_GT(profile_of(views)[8], 0.98F);
}

TEST(Correlation, robust_ignores_a_contradicting_camera) {
  const Luminance reference(noise(0)), other(noise(50));
  WindowViews views;
  views.count = 3;
  views.view = {window_at(reference, 80, 60, 0), window_at(reference, 80, 60, 1),
                window_at(other, 80, 60, 1)};
  const DepthProfile all = profile_of(views, {.robust = false});
  const DepthProfile robust = profile_of(views);
  for (int k = 0; k < kDepthSteps; ++k) EXPECT_GE(robust[k], all[k]);
  EXPECT_GE(*std::min_element(robust.begin(), robust.end()), 0);
}

PairAgreement pairs_of(const WindowViews& views) {
  PairAgreement agreement;
  correlate_pairs(views, {}, 0.5F, agreement);
  return agreement;
}

TEST(Correlation, of_pairs_accepts_two_agreeing_cameras_among_others) {
  const Luminance one(noise(0)), same(noise(3)), another(noise(50)), third(noise(6));
  WindowViews views;
  views.count = 3;
  views.view = {window_at(another, 80, 60, 1), window_at(one, 80, 60, 0),
                window_at(same, 80, 60, 1)};
  const PairAgreement two = pairs_of(views);
  const auto best = std::max_element(two.score.begin(), two.score.end()) - two.score.begin();
  EXPECT_EQ(best - 8, 3);  // steps out
  EXPECT_EQ(two.agreeing[11], 0b110);
  EXPECT_EQ(two.agreeing[8], 0);
  EXPECT_GT(two.score[11], 0.49F);  // the next pair has little correlation
  EXPECT_LT(two.score[11], 0.7F);
  views.view[0] = window_at(third, 80, 60, 2);
  EXPECT_GT(pairs_of(views).score[11], 0.98F);
  EXPECT_EQ(pairs_of(views).agreeing[11], 0b111);
}

TEST(Correlation, a_window_fits_when_all_its_samples_at_all_depths_do) {
  const Luminance image(noise(0));
  EXPECT_TRUE(window_fits(window_at(image, 80, 60, 1), {}));
  // The picture begins 24 pixels before its frame: 3 for the window, 8 steps inwards.
  EXPECT_TRUE(window_fits(window_at(image, -12, 60, 1), {}));
  EXPECT_FALSE(window_fits(window_at(image, -13.5F, 60, 1), {}));
  EXPECT_FALSE(window_fits(window_at(image, 80, 60, std::nanf("")), {}));
}

TEST(Correlation, is_the_same_to_the_bit_on_every_instruction_set) {
  const Luminance reference(noise(0)), shifted(noise(3));
  std::mt19937 random(3);
  const auto coordinate = [&] { return 40 + 0.01F * static_cast<float>(random() % 4000); };
  for (int i = 0; i < 20; ++i) {
    WindowViews views;
    views.count = 4;
    for (int c = 0; c < 4; ++c) {
      views.view[c] = window_at(c % 2 ? shifted : reference, coordinate(), coordinate(), 0.37F);
    }
    const DepthProfile expected = profile_of(views);
    const PairAgreement pairs = pairs_of(views);
    on_every_instruction_set([&] {
      EXPECT_EQ(profile_of(views), expected);
      EXPECT_EQ(pairs_of(views).score, pairs.score);
      EXPECT_EQ(pairs_of(views).agreeing, pairs.agreeing);
    });
  }
}

TEST(Luminance, removes_the_mosaic_pattern) {
  Image raw(kSize, PixelFormat::kBayerRG8);
  for (int y = 0; y < kSize.height; ++y) {
    for (int x = 0; x < kSize.width; ++x) {
      raw.row(y)[x] = std::array{200, 100, 40}[bayer_channel(raw.format, x, y)];
    }
  }
  Mask mask(kSize);
  for (int y = 31; y < 90; ++y) mask.fill_row(y, 33, 121);
  const Luminance whole(observe("cam", {}, raw.view(), mask));
  for (const Luminance& picture : {whole, whole.halved()}) {
    for (int i = 0; i < picture.width() * picture.height(); ++i) {
      ASSERT_EQ(picture.quads()[i], 0x6E6E6E6EU);  // (200 + 2 * 100 + 40) / 4
    }
  }
}

TEST(Luminance, keeps_positions_at_half_resolution) {
  Image image(kSize, PixelFormat::kMono8);
  for (int y = 0; y < kSize.height; ++y) {
    for (int x = 0; x < kSize.width; ++x) image.row(y)[x] = static_cast<uint8_t>(x);
  }
  Mask mask(kSize);
  for (int y = 30; y < 90; ++y) mask.fill_row(y, 40, 120);
  const Luminance whole(observe("cam", {}, image.view(), mask)), half = whole.halved();
  // The middle between pixels 60 and 61 of the camera, (61, 61) where the first pixel's middle is
  // (0.5, 0.5), is a pixel's middle at half resolution.
  const float u = 61 * half.scale() - half.first_u(), v = 61 * half.scale() - half.first_v();
  EXPECT_EQ(u, std::floor(u));
  const uint32_t quad = half.quads()[static_cast<int>(v) * half.width() + static_cast<int>(u)];
  EXPECT_NEAR(quad & 255, 60.5, 0.51);
}

}  // namespace
}  // namespace v3d::recon
