#include "segment_quality/segment_trials.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <bit>

#include "base/image/colour.h"
#include "capture/segmentation/mask_cleanup.h"
#include "capture/segmentation/segmenter.h"
#include "peers/opencv_subtractor.h"

namespace v3d::bench {
namespace {

constexpr int kRounds = 2;  ///< number of times the subtractors learn the plates
constexpr double kMog2Thresholds[] = {9, 16, 25, 36, 50, 75, 110, 160, 250, 400};
constexpr double kKnnThresholds[] = {50, 100, 200, 400, 800, 1600, 3200};

/// Clean-up of a subtractor's result. `pieces`: the clean-up of our segmenter.
struct CleanUp {
  std::string name;
  int open_px = 0;
  int close_px = 0;
  bool pieces = false;
};

const std::vector<CleanUp>& clean_ups() {
  static const std::vector<CleanUp> kCleanUps = {{"no clean-up"},
                                                 {"open 3, close 5", 3, 5},
                                                 {"open 3, close 11", 3, 11},
                                                 {"open 5, close 11", 5, 11},
                                                 {"our clean-up", 0, 0, true},
                                                 {"open 3, close 5, our clean-up", 3, 5, true}};
  return kCleanUps;
}

Mask cleaned(const Image& foreground, const CleanUp& how) {
  Mask mask = mask_from_image(open_and_close(foreground, how.open_px, how.close_px).view());
  if (how.pieces) segmentation::MaskCleanup().clean(mask, segmentation::SegmentOptions());
  return mask;
}

/// Marks values of at least `level` as foreground: 0 background, 127 shadow, 255 foreground.
Image from_level(ImageView labels, uint8_t level) {
  Image foreground(labels.size, PixelFormat::kMono8);
  std::transform(labels.bytes.begin(), labels.bytes.end(), foreground.bytes.begin(),
                 [&](uint8_t label) { return label >= level ? uint8_t{255} : uint8_t{0}; });
  return foreground;
}

std::vector<ImageView> views_of(const std::vector<Image>& images) {
  std::vector<ImageView> views;
  for (const Image& image : images) views.push_back(image.view());
  return views;
}

struct Input {
  const char* name;
  Image (*of)(ImageView rgb);
};
Image copy(ImageView rgb) { return crop(rgb, {0, 0, rgb.size.width, rgb.size.height}); }
Image filtered(ImageView rgb) { return mosaic(rgb, PixelFormat::kBayerRG8); }
Image demosaiced(ImageView rgb) { return to_rgb(filtered(rgb).view()); }

constexpr Input kCameraInputs[] = {{"raw", filtered}, {"demosaiced", demosaiced}};
constexpr Input kColourInputs[] = {{"colour", copy}};
std::span<const Input> inputs_of(SubtractorInput input_kind) {
  if (input_kind == SubtractorInput::kCamera) return kCameraInputs;
  return kColourInputs;
}

std::vector<Image> prepared(const std::vector<Image>& images, const Input& input) {
  std::vector<Image> out;
  for (const Image& image : images) out.push_back(input.of(image.view()));
  return out;
}

struct Setting {
  SubtractorOptions options;
  const Input* input;
};

std::vector<Setting> settings_of(const std::string& method, SubtractorInput input_kind) {
  std::vector<Setting> settings;
  const bool mog2 = method == "MOG2";
  const auto kind = mog2 ? SubtractorOptions::Method::kMog2 : SubtractorOptions::Method::kKnn;
  const std::span<const double> thresholds =
      mog2 ? std::span<const double>(kMog2Thresholds) : std::span<const double>(kKnnThresholds);
  for (const double threshold : thresholds) {
    for (const Input& input : inputs_of(input_kind)) {
      settings.push_back({{.method = kind, .threshold = threshold, .shadows = true}, &input});
    }
  }
  return settings;
}

constexpr uint8_t kShadowLevels[] = {255, 127};

/// Adds one trial for each treatment of shadows and each clean-up.
std::vector<Trial> trials_of(const Setting& setting, const std::vector<TrialScene>& scenes) {
  std::vector<Trial> trials;
  for (const uint8_t level : kShadowLevels) {
    for (const CleanUp& how : clean_ups()) {
      const auto threshold = static_cast<int>(setting.options.threshold);
      trials.push_back({"threshold " + std::to_string(threshold) + ", " + setting.input->name +
                            (level == 255 ? ", shadows told, " : ", shadows not told, ") + how.name,
                        {}});
    }
  }
  for (const TrialScene& scene : scenes) {
    OpencvSubtractor subtractor(setting.options);
    const std::vector<Image> plates = prepared(scene.plates, *setting.input);
    subtractor.learn(views_of(plates), kRounds);
    for (const Composite& composite : scene.composites) {
      const ImageView labels =
          subtractor.segment(setting.input->of(composite.colour.view()).view());
      size_t n = 0;
      for (const uint8_t level : kShadowLevels) {
        const Image foreground = from_level(labels, level);
        for (const CleanUp& how : clean_ups()) {
          trials[n++].score.add(cleaned(foreground, how), composite.truth);
        }
      }
    }
  }
  return trials;
}

segmentation::Segmenter our_segmenter(const TrialScene& scene) {
  const std::vector<Image> plates = prepared(scene.plates, kCameraInputs[0]);
  return {segmentation::learn_background(views_of(plates)), segmentation::SegmentOptions{}};
}

}  // namespace

void Score::add(const Mask& said, const Mask& truth) {
  for (int y = 0; y < truth.size().height; ++y) {
    for (size_t w = 0; w < truth.row(y).size(); ++w) {
      const uint64_t a = said.row(y)[w];
      const uint64_t b = truth.row(y)[w];
      hits += std::popcount(a & b);
      false_alarms += std::popcount(a & ~b);
      misses += std::popcount(b & ~a);
    }
  }
}

Score& Score::operator+=(const Score& other) {
  hits += other.hits;
  false_alarms += other.false_alarms;
  misses += other.misses;
  return *this;
}

double Score::precision() const {
  return static_cast<double>(hits) / static_cast<double>(std::max<int64_t>(hits + false_alarms, 1));
}
double Score::recall() const {
  return static_cast<double>(hits) / static_cast<double>(std::max<int64_t>(hits + misses, 1));
}
double Score::f() const {
  return 2 * static_cast<double>(hits) /
         static_cast<double>(std::max<int64_t>(2 * hits + false_alarms + misses, 1));
}

Trial our_trial(const std::vector<TrialScene>& scenes) {
  Trial trial{"default options, raw", {}};
  for (const TrialScene& scene : scenes) {
    segmentation::Segmenter segmenter = our_segmenter(scene);
    for (const Composite& composite : scene.composites) {
      trial.score.add(segmenter.segment(filtered(composite.colour.view()).view()), composite.truth);
    }
  }
  return trial;
}

std::vector<Trial> peer_trials(const std::string& method, SubtractorInput input_kind,
                               const std::vector<TrialScene>& scenes) {
  const std::vector<Setting> settings = settings_of(method, input_kind);
  std::vector<std::vector<Trial>> all(settings.size());
  tbb::parallel_for(size_t{0}, settings.size(),
                    [&](size_t n) { all[n] = trials_of(settings[n], scenes); });
  std::vector<Trial> trials;
  for (const std::vector<Trial>& some : all) trials.insert(trials.end(), some.begin(), some.end());
  return trials;
}

Mask our_mask(const TrialScene& scene, const Composite& composite) {
  return our_segmenter(scene).segment(filtered(composite.colour.view()).view());
}

}  // namespace v3d::bench
