#include "calib/colour/colour_fit.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

#include "base/core/error.h"
#include "calib/boards/detectors.h"
#include "calib/rig/reports.h"
#include "sim/rendering/noise.h"
#include "support/address_sanitizer.h"
#include "support/message_of.h"
#ifdef V3D_ADDRESS_SANITIZER
#include <sanitizer/lsan_interface.h>
#endif

namespace v3d::calib {
namespace {

using Eigen::Vector3d;
using testing::HasSubstr;

// Pairs from the paper's table of test data.
TEST(DeltaE, agrees_with_the_published_table) {
  struct Pair {
    Vector3d one, two;
    double delta_e;
  };
  const Pair pairs[] = {{{50, 2.6772, -79.7751}, {50, 0, -82.7485}, 2.0425},
                        {{50, -1.3802, -84.2814}, {50, 0, -82.7485}, 1.0000},
                        {{50, 0, 0}, {50, -1, 2}, 2.3669},
                        {{50, 2.49, -0.001}, {50, -2.49, 0.0009}, 7.1792},
                        {{50, 2.49, -0.001}, {50, -2.49, 0.0011}, 7.2195},
                        {{50, 2.5, 0}, {50, 0, -2.5}, 4.3065},
                        {{50, 2.5, 0}, {73, 25, -18}, 27.1492},
                        {{50, 2.5, 0}, {61, -5, 29}, 22.8977},
                        {{50, 2.5, 0}, {56, -27, -3}, 31.9030},
                        {{60.2574, -34.0099, 36.2677}, {60.4626, -34.1751, 39.4387}, 1.2644},
                        {{2.0776, 0.0795, -1.135}, {0.9033, -0.0636, -0.5514}, 0.9082}};
  for (const auto& [one, two, expected] : pairs) {
    EXPECT_NEAR(delta_e_2000(one, two), expected, 1e-4);
    EXPECT_NEAR(delta_e_2000(two, one), expected, 1e-4);
  }
}

TEST(Lab, of_white_has_lightness_100) {
  EXPECT_LT((lab_of({1, 1, 1}) - Vector3d(100, 0, 0)).norm(), 1e-9);
}

const std::vector<std::string> kNames = {"cam01", "cam02", "cam03", "cam04", "cam05", "cam06"};

/// The grey value of a surface in a simulated camera, with noise of 0.7 grey values.
Vector3d shown(const std::string& camera, const Vector3d& light, uint64_t number) {
  const sim::SensorColour sensor = sim::sensor_colour(camera, 1, 7);
  Vector3d grey = 255 * (sensor.black + sensor.matrix * light.cast<float>()).cast<double>();
  for (uint64_t k = 0; k < 3; ++k) grey[static_cast<long>(k)] += sim::uniform(number, k, -1.2, 1.2);
  return grey;
}

/// Samples of random surfaces; each camera observes half of them.
std::vector<ColourSample> views(int places) {
  std::vector<ColourSample> samples;
  for (int place = 0; place < places; ++place) {
    const auto n = static_cast<uint64_t>(place);
    const Vector3d light(sim::uniform(n, 10, 0.05, 0.8), sim::uniform(n, 11, 0.05, 0.8),
                         sim::uniform(n, 12, 0.05, 0.8));
    for (int c = 0; c < std::ssize(kNames); ++c) {
      if (sim::uniform(n, 20 + c, 0, 1) < 0.5) continue;
      samples.push_back({place, c, shown(kNames[c], light, sim::mix(n) + c)});
    }
  }
  return samples;
}

TEST(ColourFit, from_unknown_surfaces_equalises_the_cameras) {
  const ColourFit fit = fit_views(views(400), {kNames});
  EXPECT_GT(fit.overall.before, 4);
  EXPECT_LT(fit.overall.after, 0.8);
  EXPECT_LT(fit.ninety_percent.after, 2);
  for (const ColourDifference& camera : fit.differences) EXPECT_LT(camera.after, 1);
}

TEST(ColourFit, keeps_the_mean_brightness_and_white_of_the_rig) {
  const ColourFit fit = fit_views(views(400), {kNames});
  Vector3d sum = Vector3d::Zero();
  for (const ColourResponse& response : fit.responses) sum += response.corrected({99, 99, 99});
  EXPECT_LT((sum / kNames.size() - Vector3d(99, 99, 99)).norm(), 1e-6);
}

/// The mean of what cameras `first` to `last` show of a grey of 99.
Vector3d mean_of_grey(const ColourFit& fit, int first, int last) {
  Vector3d sum = Vector3d::Zero();
  for (int c = first; c <= last; ++c) sum += fit.responses[c].corrected({99, 99, 99});
  return sum / (last - first + 1);
}

TEST(ColourFit, does_not_change_the_brightness_by_a_camera_that_shares_no_place) {
  std::vector<ColourSample> samples = views(1200);
  std::erase_if(samples, [](const ColourSample& sample) { return sample.camera == 5; });
  const ColourFit fit = fit_views(samples, {kNames});
  EXPECT_EQ(fit.fitted, std::vector<bool>({true, true, true, true, true, false}));
  EXPECT_LT((mean_of_grey(fit, 0, 4) - Vector3d(99, 99, 99)).norm(), 1e-6);
  EXPECT_LT((mean_of_grey(fit, 5, 5) - Vector3d(99, 99, 99)).norm(), 1e-6);
}

TEST(ColourFit, keeps_the_mean_brightness_of_each_group_of_cameras_that_share_places) {
  std::vector<ColourSample> samples = views(1200);
  std::erase_if(samples, [](const ColourSample& s) { return s.place % 2 != s.camera / 3; });
  const ColourFit fit = fit_views(samples, {kNames});
  EXPECT_LT((mean_of_grey(fit, 0, 2) - Vector3d(99, 99, 99)).norm(), 1e-6);
  EXPECT_LT((mean_of_grey(fit, 3, 5) - Vector3d(99, 99, 99)).norm(), 1e-6);
}

TEST(ColourFit, is_robust_to_wrong_samples) {
  std::vector<ColourSample> samples = views(400);
  for (size_t i = 0; i < samples.size(); i += 10) samples[i].grey = {240, 20, 130};
  const ColourFit fit = fit_views(samples, {kNames});
  std::vector<double> apart;
  const auto cleaned = views(400);
  const ColourFit clean = fit_views(cleaned, {kNames});
  for (size_t c = 0; c < kNames.size(); ++c) {
    const Vector3d grey(120, 90, 150);
    EXPECT_LT((fit.responses[c].corrected(grey) - clean.responses[c].corrected(grey)).norm(), 4);
  }
}

TEST(ColourFit, uses_known_black_levels) {
  ColourOptions options{kNames};
  for (const std::string& name : kNames) {
    options.black.push_back(255 * sim::sensor_colour(name, 1, 7).black.cast<double>());
  }
  const ColourFit fit = fit_views(views(400), options);
  for (size_t c = 0; c < kNames.size(); ++c) {
    EXPECT_LT((fit.responses[c].black - options.black[c]).norm(), 0.01);
  }
  EXPECT_LT(fit.overall.after, 0.8);
}

TEST(ColourFit, from_a_chart_gives_its_true_colours_at_the_mean_brightness) {
  std::vector<ColourSample> samples;
  for (int patch = 0; patch < 24; ++patch) {
    for (int c = 0; c < std::ssize(kNames); ++c) {
      samples.push_back({patch, c, shown(kNames[c], 0.8 * chart_colour(patch), 9 * patch + c)});
    }
  }
  const ColourFit fit = fit_chart(samples, {kNames});
  EXPECT_GT(fit.overall.before, 4);
  EXPECT_LT(fit.overall.after, 1);
  const Vector3d red = fit.responses[2].corrected(shown(kNames[2], 0.8 * chart_colour(14), 1));
  EXPECT_LT((red - 255 * 0.8 * chart_colour(14)).norm(), 6);
}

TEST(ColourFit, from_a_grey_card_balances_white) {
  std::vector<ColourSample> samples;
  for (int c = 0; c < std::ssize(kNames); ++c) {
    samples.push_back({0, c, shown(kNames[c], {0.4, 0.4, 0.4}, c)});
  }
  const ColourFit fit = fit_grey(samples, {kNames});
  for (const ColourSample& sample : samples) {
    const Vector3d grey = fit.responses[sample.camera].corrected(sample.grey);
    EXPECT_LT(grey.maxCoeff() - grey.minCoeff(), 1e-9);
  }
  EXPECT_LT(fit.overall.after, 1e-6);
}

TEST(ColourFit, compares_a_grey_card_in_many_images_with_the_other_cameras_only) {
  std::vector<ColourSample> once, often;
  for (int c = 0; c < std::ssize(kNames); ++c) {
    once.push_back({0, c, shown(kNames[c], {0.4, 0.4, 0.4}, c)});
    often.insert(often.end(), 20, once.back());
  }
  const ColourFit expected = fit_grey(once, {kNames}), fit = fit_grey(often, {kNames});
  EXPECT_EQ(fit.overall.places, std::ssize(kNames));
  EXPECT_NEAR(fit.overall.before, expected.overall.before, 1e-9);
  for (size_t c = 0; c < kNames.size(); ++c) {
    EXPECT_EQ(fit.differences[c].places, 1);
    EXPECT_NEAR(fit.differences[c].before, expected.differences[c].before, 1e-9);
  }
  const ColourFit alone = fit_grey(std::vector(20, once[0]), {{"cam01"}});
  EXPECT_EQ(alone.overall.places, 0) << "it shares no place with another camera";
}

TEST(ColourFit, reports_missing_samples) {
  EXPECT_THAT(test::message_of<InputError>([] { fit_views(views(5), {kNames}); }),
              HasSubstr("places are seen by several cameras"));
  EXPECT_THAT(test::message_of<InputError>([] {
                const ColourSample one{3, 0, {99, 99, 99}};
                fit_chart({&one, 1}, {kNames});
              }),
              HasSubstr("cam01 shows 1 well exposed patches"));
  EXPECT_THAT(test::message_of<InputError>([] { fit_grey({}, {kNames}); }),
              HasSubstr("cam01 shows no well exposed grey"));
}

/// A chart with black borders between its patches, on a grey background.
Image chart_image(int patch_px) {
  const int step = patch_px * 5 / 4, border = patch_px;
  Image image({6 * step + 4 * border, 4 * step + 4 * border}, PixelFormat::kRGB8);
  for (int y = 0; y < image.size.height; ++y) {
    for (int x = 0; x < image.size.width; ++x) {
      const int i = x - 2 * border, j = y - 2 * border;
      const bool on_chart = i >= -border / 2 && j >= -border / 2 && i < 6 * step + border / 4 &&
                            j < 4 * step + border / 4;
      const bool on_patch = i >= 0 && j >= 0 && i < 6 * step && j < 4 * step &&
                            i % step < patch_px && j % step < patch_px;
      const Vector3d light = on_patch   ? chart_colour(j / step * 6 + i / step)
                             : on_chart ? Vector3d(0.01, 0.01, 0.01)
                                        : Vector3d(0.3, 0.3, 0.3);
      for (int k = 0; k < 3; ++k) {
        image.row(y)[3 * x + k] = static_cast<uint8_t>(std::lround(220 * light[k]));
      }
    }
  }
  return image;
}

/// OpenCV allocates its Lab tables once and never frees them. They are allocated here, where
/// LeakSanitizer is disabled.
class ChartDetector : public testing::Test {
 protected:
  static void SetUpTestSuite() {
#ifdef V3D_ADDRESS_SANITIZER
    const __lsan::ScopedDisabler disabled;
#endif
    cv::Mat lab;
    cv::cvtColor(cv::Mat::zeros(1, 1, CV_8UC3), lab, cv::COLOR_BGR2Lab);
  }
};

TEST_F(ChartDetector, finds_the_patches_and_their_colours) {
  const auto chart = find_chart(chart_image(60).view());
  ASSERT_TRUE(chart.has_value());
  for (int patch = 0; patch < 24; ++patch) {
    EXPECT_LT(((*chart)[static_cast<size_t>(patch)] - 220 * chart_colour(patch)).norm(), 6)
        << patch;
  }
}

TEST_F(ChartDetector, finds_nothing_in_an_image_without_a_chart) {
  EXPECT_FALSE(find_chart(Image({640, 480}, PixelFormat::kRGB8).view()).has_value());
}

TEST(ColourReport, contains_every_camera_before_and_after) {
  const auto samples = views(400);
  const std::string html = colour_report_html(kNames, fit_views(samples, {kNames}), samples);
  for (const std::string& name : kNames) EXPECT_THAT(html, HasSubstr("<td>" + name + "</td>"));
  EXPECT_THAT(html, HasSubstr("<h2>After</h2>"));
}

}  // namespace
}  // namespace v3d::calib
