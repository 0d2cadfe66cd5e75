// bar-colours LOG PULSE: compares a recorded picture with the colour bars of the kernel's vivid
// driver.
//
// Prints the format of the picture and how far its eight bars are from their colours: the greatest
// difference of a channel of the mean colour of a bar, in grey levels of 8 bits. A picture with one
// channel is compared with the luma of the bars.
#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstring>
#include <exception>

#include "base/image/colour.h"
#include "base/image/image.h"
#include "take/logs/frame_log.h"

namespace {

using Rgb = std::array<double, 3>;

/// From left to right: white, yellow, cyan, green, magenta, red, blue, black, in vivid's pattern
/// "75% Colorbar".
constexpr std::array<Rgb, 8> kBars = {{{191, 191, 191},
                                       {191, 191, 0},
                                       {0, 191, 191},
                                       {0, 191, 0},
                                       {191, 0, 191},
                                       {191, 0, 0},
                                       {0, 0, 191},
                                       {0, 0, 0}}};

/// The mean colour of the middle of a bar. The edges of bars are left out, because chroma and
/// mosaics mix the colours of neighbours there.
Rgb mean_colour(const v3d::Image& picture, size_t bar) {
  const int width = picture.size.width / static_cast<int>(kBars.size());
  const int first = static_cast<int>(bar) * width + width / 4;
  const int last = first + width / 2;
  Rgb sum{};
  for (int y = picture.size.height / 4; y < picture.size.height * 3 / 4; ++y) {
    for (int x = first; x < last; ++x) {
      const auto pixel = static_cast<size_t>(y * picture.size.width + x);
      for (size_t c = 0; c < 3; ++c) sum[c] += picture.bytes[3 * pixel + c];
    }
  }
  const double pixels =
      double(last - first) * (picture.size.height * 3 / 4 - picture.size.height / 4);
  for (double& channel : sum) channel /= pixels;
  return sum;
}

/// The luma of BT.709, in full range.
Rgb luma(const Rgb& colour) {
  const double y = 0.2126 * colour[0] + 0.7152 * colour[1] + 0.0722 * colour[2];
  return {y, y, y};
}

int compare(const std::filesystem::path& log, int64_t pulse) {
  v3d::take::FrameLogReader frames(log);
  auto frame = frames.read_deep(pulse);
  if (!frame) {
    fmt::print(stderr, "bar-colours: {}: no frame of pulse {}\n", log.string(), pulse);
    return 1;
  }
  const v3d::PixelFormat format = frame->image.format;
  const bool is_grey = format != v3d::PixelFormat::kRGB8 && !v3d::is_bayer(format);
  v3d::reduce_to_8_bits(frame->image);
  const v3d::Image picture = v3d::to_rgb(frame->image.view());
  double difference = 0;
  for (size_t bar = 0; bar < kBars.size(); ++bar) {
    const Rgb expected = is_grey ? luma(kBars[bar]) : kBars[bar];
    const Rgb found = mean_colour(picture, bar);
    for (size_t c = 0; c < 3; ++c) {
      difference = std::max(difference, std::abs(found[c] - expected[c]));
    }
  }
  fmt::print("{} {:.0f}\n", v3d::name(format), std::ceil(difference));
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  int64_t pulse = 0;
  if (argc != 3 ||
      std::from_chars(argv[2], argv[2] + std::strlen(argv[2]), pulse).ec != std::errc()) {
    fmt::print(stderr, "usage: bar-colours LOG PULSE\n");
    return 2;
  }
  try {
    return compare(argv[1], pulse);
  } catch (const std::exception& error) {
    fmt::print(stderr, "bar-colours: {}\n", error.what());
    return 1;
  }
}
