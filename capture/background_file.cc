// Background models on disk. The only file here that includes OpenCV, for PNG.

#include <fstream>
#include <iterator>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <optional>

#include "base/error.h"
#include "base/file.h"
#include "base/toml_file.h"
#include "capture/segmenter.h"

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

/// OpenCV keeps colours as blue, green, red.
int file_index(int channels, int i) { return channels == 3 ? i - i % 3 + 2 - i % 3 : i; }

void save_values(const fs::path& path, ImageSize size, const std::vector<float>& values) {
  const int channels = static_cast<int>(static_cast<int64_t>(values.size()) / size.pixels());
  cv::Mat picture(size.height, size.width, CV_MAKETYPE(CV_16U, channels));
  auto* out = picture.ptr<uint16_t>();
  for (int i = 0; i < static_cast<int>(values.size()); ++i) {
    out[file_index(channels, i)] = cv::saturate_cast<uint16_t>(values[i] * 256);
  }
  std::vector<uchar> png;
  if (!cv::imencode(".png", picture, png)) throw InputError(path.string() + ": PNG refused");
  replace_file(path, {reinterpret_cast<const char*>(png.data()), png.size()});
}

cv::Mat decode(const fs::path& path) {
  const std::string bytes = read_file(path);
  cv::Mat picture;
  try {
    const std::vector<uchar> png(bytes.begin(), bytes.end());
    if (!png.empty()) picture = cv::imdecode(png, cv::IMREAD_UNCHANGED);
  } catch (const cv::Exception&) {
    picture.release();
  }
  if (picture.empty()) throw InputError(path.string() + ": is no PNG image, or a damaged one");
  return picture;
}

/// Values of a picture of the wanted kind; sets `size` when it is not known yet.
std::vector<float> load_values(const fs::path& path, PixelFormat format, ImageSize& size) {
  const cv::Mat picture = decode(path);
  const int channels = bytes_per_pixel(format);
  if (picture.depth() != CV_16U || picture.channels() != channels) {
    throw InputError(path.string() + ": right would be 16 bits and " + std::to_string(channels) +
                     " channel(s) for " + std::string(name(format)));
  }
  if (size == ImageSize{}) size = {picture.cols, picture.rows};
  if (size != ImageSize{picture.cols, picture.rows}) {
    throw InputError(path.string() + ": is not of the size of the mean image, " +
                     std::to_string(size.width) + "x" + std::to_string(size.height));
  }
  std::vector<float> values(byte_count(size, format));
  const auto* in = picture.ptr<uint16_t>();
  for (int i = 0; i < static_cast<int>(values.size()); ++i) {
    values[i] = static_cast<float>(in[file_index(channels, i)]) / 256;
  }
  return values;
}

PixelFormat load_format(const fs::path& path) {
  const TomlTable table = TomlTable::load(path);
  const auto format = pixel_format_from_name(table.text("pixel_format"));
  if (!format) table.fail("pixel_format", "is not known; right would be e.g. \"BayerRG8\"");
  table.refuse_unknown();
  return *format;
}

}  // namespace

void save_background(const fs::path& folder, const std::string& camera,
                     const BackgroundModel& model) {
  const Paths paths(folder, camera);
  std::error_code error;
  fs::create_directories(folder, error);
  save_values(paths.mean, model.size, model.mean);
  save_values(paths.spread, model.size, model.spread);
  replace_file(paths.info, "pixel_format = " + toml_string(name(model.format)) + "\n");
}

BackgroundModel load_background(const fs::path& folder, const std::string& camera) {
  const Paths paths(folder, camera);
  BackgroundModel model;
  model.format = load_format(paths.info);
  model.mean = load_values(paths.mean, model.format, model.size);
  model.spread = load_values(paths.spread, model.format, model.size);
  return model;
}

bool has_background(const fs::path& folder, const std::string& camera) {
  const Paths paths(folder, camera);
  return fs::exists(paths.info) && fs::exists(paths.mean) && fs::exists(paths.spread);
}

}  // namespace v3d
