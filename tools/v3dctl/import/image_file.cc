#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <cstdio>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <string_view>

#include "base/core/error.h"
#include "base/io/file.h"
#include "base/io/unique_fd.h"
#include "v3dctl/import/media.h"

namespace v3d::ctl {
namespace {

namespace fs = std::filesystem;

/// Limit of a file. Images of cameras have some MB; a sparse file may have any length.
constexpr uint64_t kMaxImageBytes = 256 << 20;

// libjpeg fills missing parts of a truncated file with grey and only warns. A complete file has an
// end-of-image marker, followed by little padding.
bool is_truncated_jpeg(const std::vector<uint8_t>& bytes) {
  if (bytes.size() < 4 || bytes[0] != 0xFF || bytes[1] != 0xD8) return false;
  const size_t tail = bytes.size() - std::min<size_t>(bytes.size(), 256);
  for (size_t i = tail; i + 1 < bytes.size(); ++i) {
    if (bytes[i] == 0xFF && bytes[i + 1] == 0xD9) return false;
  }
  return true;
}

// Discards warnings that the image libraries print (a colour profile, a damaged block); InputError
// has the cause. Not for use while other threads print.
class QuietLibraries {
 public:
  QuietLibraries() : stderr_(fcntl(STDERR_FILENO, F_DUPFD_CLOEXEC, 3)) {
    std::fflush(stderr);
    const io::UniqueFd nowhere(open("/dev/null", O_WRONLY | O_CLOEXEC));
    if (nowhere) dup2(nowhere.get(), STDERR_FILENO);
  }
  ~QuietLibraries() {
    if (!stderr_) return;
    std::fflush(stderr);
    dup2(stderr_.get(), STDERR_FILENO);
  }
  QuietLibraries(const QuietLibraries&) = delete;
  QuietLibraries& operator=(const QuietLibraries&) = delete;

 private:
  const io::UniqueFd stderr_;
};

cv::Mat decode(const fs::path& path, int flags) {
  const std::string text = io::value_or_throw(io::read_file(path, kMaxImageBytes));
  const std::vector<uint8_t> bytes(text.begin(), text.end());
  cv::Mat image;
  if (!bytes.empty() && !is_truncated_jpeg(bytes)) {
    const QuietLibraries quiet;
    try {
      image = cv::imdecode(bytes, flags | cv::IMREAD_IGNORE_ORIENTATION);
    } catch (const cv::Exception&) {
      image.release();
    }
  }
  if (image.empty()) {
    throw InputError(path.string() +
                     ": no readable image: truncated, damaged, or of an unknown kind");
  }
  return image;
}

Image to_image(const cv::Mat& bgr) {
  Image image({bgr.cols, bgr.rows}, PixelFormat::kRGB8);
  cv::Mat rgb(bgr.rows, bgr.cols, CV_8UC3, image.bytes.data());
  cv::cvtColor(bgr, rgb, cv::COLOR_BGR2RGB);
  return image;
}

cv::Mat disc(int radius) {
  return cv::getStructuringElement(cv::MORPH_ELLIPSE, {2 * radius + 1, 2 * radius + 1});
}

}  // namespace

Image read_image(const fs::path& path) { return to_image(decode(path, cv::IMREAD_COLOR)); }

Mask read_mask(const fs::path& path) {
  const cv::Mat grey = decode(path, cv::IMREAD_GRAYSCALE);
  const auto bytes = std::span(grey.data, grey.total());
  return mask_from_image({{grey.cols, grey.rows}, PixelFormat::kMono8, bytes});
}

Mask mask_before_black(ImageView image, const BlackBackground& black) {
  const double level = 255 * black.level;
  cv::Mat bright(image.size.height, image.size.width, CV_8UC1);
  for (int y = 0; y < image.size.height; ++y) {
    const uint8_t* rgb = image.row(y);
    for (int x = 0; x < image.size.width; ++x, rgb += 3) {
      bright.at<uint8_t>(y, x) = std::max({rgb[0], rgb[1], rgb[2]}) > level ? 255 : 0;
    }
  }
  cv::dilate(bright, bright, disc(black.dilate_px));
  cv::erode(bright, bright, disc(black.erode_px));
  return mask_from_image({image.size, PixelFormat::kMono8, std::span(bright.data, bright.total())});
}

bool has_image_name(const fs::path& path) {
  std::string extension = path.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  constexpr std::string_view kKnown[] = {".png",  ".jpg", ".jpeg", ".bmp", ".tif",
                                         ".tiff", ".ppm", ".pgm",  ".webp"};
  return std::find(std::begin(kKnown), std::end(kKnown), extension) != std::end(kKnown);
}

}  // namespace v3d::ctl
