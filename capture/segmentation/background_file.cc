// Reads and writes background models.

#include <algorithm>
#include <array>
#include <cmath>

#include "base/config/toml_file.h"
#include "base/core/error.h"
#include "base/image/image_size.h"
#include "base/image/png_file.h"
#include "base/io/file.h"
#include "base/io/whole_file.h"
#include "capture/segmentation/background.h"

namespace v3d {
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
  if (!format) table.fail("pixel_format", "is not known; expected e.g. \"BayerRG8\"");
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
  std::string info = "pixel_format = " + toml_string(name(model.format)) + "\n";
  if (model.key != ChromaKey::kNone) {
    info += "chroma_key = " + toml_string(name(model.key)) + "\n";
  }
  replace_file(paths.info, info);
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

}  // namespace v3d
