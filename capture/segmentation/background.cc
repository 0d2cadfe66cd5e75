// Learns a background model: mean and standard deviation of every sample over the plates.

#include "capture/segmentation/background.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include "base/config/toml_file.h"
#include "base/core/error.h"
#include "base/image/image.h"
#include "base/image/image_files.h"
#include "base/io/file.h"
#include "capture/segmentation/image_measures.h"

namespace v3d::segmentation {
namespace {

void check(const std::vector<ImageView>& plates) {
  if (plates.size() < 2) {
    throw InputError("background: " + std::to_string(plates.size()) +
                     " plates; expected 2 or more");
  }
  for (const ImageView& plate : plates) {
    if (plate.size != plates[0].size || plate.format != plates[0].format) {
      throw InputError("background: the plates differ in size or pixel format");
    }
    if (plate.bytes.size() != byte_count(plate.size, plate.format)) {
      throw InputError("background: a plate is truncated");
    }
  }
}

/// Mean of the plates, each divided by its gain.
std::vector<float> mean_of(const std::vector<ImageView>& plates, const std::vector<float>& gains) {
  std::vector<float> mean(plates[0].bytes.size());
  for (size_t p = 0; p < plates.size(); ++p) {
    const float weight = 1 / (gains[p] * static_cast<float>(plates.size()));
    for (size_t i = 0; i < mean.size(); ++i) {
      mean[i] += weight * static_cast<float>(plates[p].bytes[i]);
    }
  }
  return mean;
}

std::vector<float> spread_of(const std::vector<ImageView>& plates, const std::vector<float>& gains,
                             const std::vector<float>& mean) {
  std::vector<float> spread(mean.size());
  for (size_t p = 0; p < plates.size(); ++p) {
    const float scale = 1 / gains[p];
    for (size_t i = 0; i < mean.size(); ++i) {
      const float d = scale * static_cast<float>(plates[p].bytes[i]) - mean[i];
      spread[i] += d * d;
    }
  }
  const auto freedom = static_cast<float>(plates.size() - 1);
  for (float& s : spread) s = std::sqrt(s / freedom);
  return spread;
}

float gain_of(ImageView plate, const std::vector<float>& mean) {
  std::vector<uint16_t> fixed(mean.size());
  std::transform(mean.begin(), mean.end(), fixed.begin(), [](float m) {
    return static_cast<uint16_t>(std::lround(std::min(m, 255.0F) * 256));
  });
  return static_cast<float>(brightness_ratio(plate, fixed)) / kUnitGain;
}

/// Rounds to the precision of the files, so that a learnt and a loaded model give the same masks.
void round_to_file(std::vector<float>& values) {
  for (float& v : values) v = std::round(std::clamp(v, 0.0F, 255.0F) * 256) / 256;
}

}  // namespace

BackgroundModel learn_background(const std::vector<ImageView>& plates) {
  check(plates);
  std::vector<float> gains(plates.size(), 1.0F);
  const std::vector<float> unscaled_mean = mean_of(plates, gains);
  std::transform(plates.begin(), plates.end(), gains.begin(),
                 [&](const ImageView& plate) { return gain_of(plate, unscaled_mean); });
  BackgroundModel model;
  model.size = plates[0].size;
  model.format = plates[0].format;
  model.mean = mean_of(plates, gains);
  model.spread = spread_of(plates, gains, model.mean);
  round_to_file(model.mean);
  round_to_file(model.spread);
  return model;
}

// Reads and writes background models.

namespace {

namespace fs = std::filesystem;

struct Paths {
  fs::path mean, spread, info;
  Paths(const fs::path& folder, const std::string& camera)
      : mean(folder / (camera + ".mean.png")),
        spread(folder / (camera + ".spread.png")),
        info(folder / (camera + ".toml")) {}
};

void save_values(const fs::path& path, PixelFormat format, ImageSize size,
                 const std::vector<float>& values) {
  DeepImage picture{size, bytes_per_pixel(format), {}};
  picture.samples.reserve(values.size());
  for (const float value : values) {
    picture.samples.push_back(
        static_cast<uint16_t>(std::clamp(std::lround(value * 256), 0L, 65535L)));
  }
  replace_file(path, encode_png(picture));
}

constexpr uint64_t kMaxPlatePictureBytes = 256 << 20;

std::string read_plate_file(const fs::path& path, uint64_t max_bytes) {
  return io::value_or_throw(io::read_file(path, max_bytes, io::OpenMode::kReadWithinFolder));
}

/// Reads the values of an image of `format`. Sets `size` if it is empty, otherwise checks it.
std::vector<float> load_values(const fs::path& path, PixelFormat format, ImageSize& size) {
  const DeepImage picture = decode_png(read_plate_file(path, kMaxPlatePictureBytes), path);
  const int channels = bytes_per_pixel(format);
  if (picture.channels != channels) {
    throw InputError(path.string() + ": expected 16 bits and " + std::to_string(channels) +
                     " channel(s) for " + std::string(name(format)));
  }
  if (size == ImageSize{}) size = picture.size;
  if (size != picture.size) {
    throw InputError(path.string() + ": size differs from that of the mean image, " +
                     format_size(size));
  }
  std::vector<float> values;
  values.reserve(picture.samples.size());
  for (const uint16_t sample : picture.samples) values.push_back(static_cast<float>(sample) / 256);
  return values;
}

void load_info(const fs::path& path, BackgroundModel& model) {
  const TomlTable table = TomlTable::parse(read_plate_file(path, kMaxTakeTextBytes), path);
  const auto format = pixel_format_from_name(table.text("pixel_format"));
  if (!format || is_deep(*format)) {
    table.fail("pixel_format", "is not known; expected e.g. \"BayerRG8\"");
  }
  const auto key = chroma_key_from_name(table.text_or("chroma_key", name(ChromaKey::kNone)));
  if (!key) table.fail("chroma_key", "is not known; expected none, green or blue");
  table.reject_unknown_fields();
  model.format = *format;
  model.key = *key;
}

}  // namespace

void save_background(const fs::path& folder, const std::string& camera,
                     const BackgroundModel& model) {
  const Paths paths(folder, camera);
  std::error_code error;
  fs::create_directories(folder, error);
  save_values(paths.mean, model.format, model.size, model.mean);
  save_values(paths.spread, model.format, model.size, model.spread);
  TomlWriter info;
  info.text("pixel_format", name(model.format));
  if (model.key != ChromaKey::kNone) info.text("chroma_key", name(model.key));
  replace_file(paths.info, info.written());
}

BackgroundModel load_background(const fs::path& folder, const std::string& camera) {
  const Paths paths(folder, camera);
  BackgroundModel model;
  load_info(paths.info, model);
  model.mean = load_values(paths.mean, model.format, model.size);
  model.spread = load_values(paths.spread, model.format, model.size);
  return model;
}

bool has_background(const fs::path& folder, const std::string& camera) {
  const Paths paths(folder, camera);
  return std::ranges::all_of(
      std::array{paths.info, paths.mean, paths.spread}, [](const auto& path) {
        return io::value_or_throw(io::type_of(path)) != fs::file_type::not_found;
      });
}

namespace {

constexpr float kMinSpread = 0.5F;  ///< grey values
constexpr float kMaxSpread = 64;
/// Above this grey value a sample is saturated, such as a lamp. Its measured spread is too small,
/// because flicker is not visible in it; kSaturatedSpread replaces it.
constexpr float kSaturated = 248;
constexpr float kSaturatedSpread = 10;
constexpr float kMaxSharpness = 255;
constexpr float kMaxSteps = 8;  ///< per spread: the squared distances of a quad fit 16 spreads

/// Maximum slope of the background, in grey values per pixel. In a Bayer image it is half the
/// difference to the neighbours of the same colour, which are two pixels away.
float slope(const BackgroundModel& model, int channels, int x, int y, int channel) {
  const int step = is_bayer(model.format) ? 2 : 1;
  const auto at = [&](int u, int v) {
    u = std::clamp(u, x % step, model.size.width - 1);
    v = std::clamp(v, y % step, model.size.height - 1);
    if ((u - x) % step) u -= 1;
    if ((v - y) % step) v -= 1;
    return model.mean[(static_cast<size_t>(v) * model.size.width + u) * channels + channel];
  };
  const float here = at(x, y);
  float steepest = 0;
  for (const float there : {at(x - step, y), at(x + step, y), at(x, y - step), at(x, y + step)}) {
    steepest = std::max(steepest, std::abs(there - here));
  }
  return steepest / static_cast<float>(step);
}

/// Minimum difference between the key's channel and the others, in grey values, and minimum ratio.
constexpr float kMinKeyDifference = 16;
constexpr float kMinKeyRatio = 1.25F;

/// Mean colour (red, green, blue) of the quad at (x, y).
std::array<float, 3> colour_of_quad(const BackgroundModel& model, int x, int y) {
  std::array<float, 3> sum{};
  std::array<int, 3> count{};
  for (const int v : {y, y + 1}) {
    for (const int u : {x, x + 1}) {
      const size_t pixel = static_cast<size_t>(v) * model.size.width + u;
      if (is_bayer(model.format)) {
        const int channel = bayer_channel(model.format, u, v);
        sum[channel] += model.mean[pixel];
        ++count[channel];
        continue;
      }
      for (int channel = 0; channel < 3; ++channel) {
        sum[channel] += model.mean[3 * pixel + channel];
        ++count[channel];
      }
    }
  }
  for (size_t channel = 0; channel < 3; ++channel)
    sum[channel] /= static_cast<float>(count[channel]);
  return sum;
}

bool has_colour_of(ChromaKey key, const std::array<float, 3>& colour) {
  const float own = colour[key == ChromaKey::kGreen ? 1 : 2];
  const float other = std::max(colour[0], colour[key == ChromaKey::kGreen ? 2 : 1]);
  return own - other >= kMinKeyDifference && own >= kMinKeyRatio * other;
}

Mask keyed_quads(const BackgroundModel& model) {
  if (model.key == ChromaKey::kNone || model.format == PixelFormat::kMono8) return {};
  Mask keyed(model.size);
  for (int y = 0; y + 1 < model.size.height; ++y) {
    for (int x = 0; x + 1 < model.size.width; ++x) {
      if (has_colour_of(model.key, colour_of_quad(model, x, y))) keyed.set(x, y);
    }
  }
  return keyed;
}

}  // namespace

BackgroundTable::BackgroundTable(const BackgroundModel& model, const SegmentOptions& options)
    : size(model.size),
      format(model.format),
      channels(bytes_per_pixel(model.format)),
      keyed(keyed_quads(model)) {
  const size_t samples = byte_count(size, format);
  V3D_CHECK(model.mean.size() == samples && model.spread.size() == samples);
  mean.resize(samples + kReach);
  sharpness.resize(samples + kReach);
  const float min_spread = std::clamp(options.noise_floor, kMinSpread, kMaxSpread);
  const float scale = kMaxSharpness * min_spread;  // of 1 / spread; 512 make 1 step per spread
  sharpness_shift = static_cast<int>(std::floor(std::log2(512 * kMaxSteps / scale)));
  sharpness_shift = std::max(sharpness_shift, 0);
  steps_per_spread = std::ldexp(scale / 512, sharpness_shift);
  size_t i = 0;
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      for (int c = 0; c < channels; ++c, ++i) {
        const float grey = std::clamp(model.mean[i], 0.0F, 255.0F);
        mean[i] = static_cast<uint16_t>(std::lround(grey * 256));
        const float floor = model.mean[i] > kSaturated ? kSaturatedSpread : kMinSpread;
        const float noise = std::max({model.spread[i], min_spread, floor});
        const float moved = options.shake * slope(model, channels, x, y, c);
        const float spread = std::min(std::sqrt(noise * noise + moved * moved), kMaxSpread);
        sharpness[i] = static_cast<uint8_t>(std::lround(scale / spread));
      }
    }
  }
}

}  // namespace v3d::segmentation
