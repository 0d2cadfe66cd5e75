#include "base/image/mask.h"

#include <algorithm>
#include <bit>

#include "base/core/error.h"

namespace v3d {
namespace {

constexpr int kWordBits = 64;

void put_varint(std::vector<uint8_t>& out, uint64_t value) {
  for (; value >= 0x80; value >>= 7) {
    out.push_back(static_cast<uint8_t>(value | 0x80));
  }
  out.push_back(static_cast<uint8_t>(value));
}

/// Reads a LEB128 number of at most 5 bytes from the start of `bytes` and removes it. 35 bits
/// suffice for kMaxImageSide squared.
std::optional<uint64_t> take_varint(std::span<const uint8_t>& bytes) {
  uint64_t value = 0;
  for (size_t i = 0; i < std::min<size_t>(bytes.size(), 5); ++i) {
    value |= uint64_t{bytes[i] & 0x7FU} << (7 * i);
    if (bytes[i] < 0x80) {
      const bool overlong = i > 0 && bytes[i] == 0;
      bytes = bytes.subspan(i + 1);
      return overlong ? std::nullopt : std::optional(value);
    }
  }
  return std::nullopt;
}

/// The first x in [x, width) of the row with a bit equal to `foreground`, else width.
int find_bit(std::span<const uint64_t> row, int x, int width, bool foreground) {
  const uint64_t flip = foreground ? 0 : ~uint64_t{0};
  while (x < width) {
    const uint64_t rest = (row[x / kWordBits] ^ flip) >> (x % kWordBits);
    if (rest != 0) {
      return std::min(width, x + std::countr_zero(rest));
    }
    x = (x / kWordBits + 1) * kWordBits;
  }
  return width;
}

}  // namespace

Mask::Mask(ImageSize size)
    : size_(size),
      words_per_row_((size.width + kWordBits - 1) / kWordBits),
      words_(static_cast<size_t>(words_per_row_) * size.height) {}

void Mask::fill_row(int y, int x_begin, int x_end) {
  const std::span<uint64_t> words = row(y);
  while (x_begin < x_end) {
    const int bit = x_begin % kWordBits;
    const int run = std::min(kWordBits - bit, x_end - x_begin);
    const uint64_t ones = run == kWordBits ? ~uint64_t{0} : (uint64_t{1} << run) - 1;
    words[x_begin / kWordBits] |= ones << bit;
    x_begin += run;
  }
}

int64_t Mask::count() const {
  int64_t n = 0;
  for (const uint64_t word : words_) {
    n += std::popcount(word);
  }
  return n;
}

Rect Mask::bounding_box() const {
  int x0 = size_.width;
  int x1 = 0;
  int y0 = size_.height;
  int y1 = 0;
  for (int y = 0; y < size_.height; ++y) {
    const auto words = row(y);
    const int first = find_bit(words, 0, size_.width, true);
    if (first == size_.width) {
      continue;
    }
    int last_word = words_per_row_ - 1;
    while (words[last_word] == 0) {
      --last_word;
    }
    x0 = std::min(x0, first);
    x1 = std::max(x1, last_word * kWordBits + kWordBits - std::countl_zero(words[last_word]));
    y0 = std::min(y0, y);
    y1 = y + 1;
  }
  return y1 == 0 ? Rect{} : Rect{x0, y0, x1 - x0, y1 - y0};
}

std::vector<uint8_t> encode_runs(const Mask& mask) {
  std::vector<uint8_t> runs;
  const ImageSize size = mask.size();
  bool foreground = false;
  uint64_t run = 0;
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width;) {
      const int end = find_bit(mask.row(y), x, size.width, !foreground);
      run += end - x;
      x = end;
      if (x < size.width) {
        put_varint(runs, run);
        run = 0;
        foreground = !foreground;
      }
    }
  }
  put_varint(runs, run);
  return runs;
}

std::optional<Mask> decode_runs(std::span<const uint8_t> runs, ImageSize size) {
  if (size.width <= 0 || size.height <= 0 || size.width > kMaxImageSide ||
      size.height > kMaxImageSide) {
    return std::nullopt;
  }
  Mask mask(size);
  const auto total = static_cast<uint64_t>(size.pixels());
  uint64_t at = 0;
  bool first = true;
  for (bool foreground = false; !runs.empty(); foreground = !foreground) {
    const auto run = take_varint(runs);
    // Only the first run can be empty: the mask then starts with foreground.
    if (!run || *run > total - at || (*run == 0 && !first)) {
      return std::nullopt;
    }
    first = false;
    for (uint64_t begin = at; foreground && begin < at + *run;) {
      const uint64_t y = begin / size.width;
      const uint64_t end = std::min(at + *run, (y + 1) * size.width);
      mask.fill_row(static_cast<int>(y), static_cast<int>(begin - y * size.width),
                    static_cast<int>(end - y * size.width));
      begin = end;
    }
    at += *run;
  }
  return at == total ? std::optional(std::move(mask)) : std::nullopt;
}

Mask mask_from_image(ImageView image) {
  V3D_CHECK(image.format == PixelFormat::kMono8);
  Mask mask(image.size);
  for (int y = 0; y < image.size.height; ++y) {
    const uint8_t* in = image.row(y);
    const auto out = mask.row(y);
    for (int x = 0; x < image.size.width; ++x) {
      out[x / kWordBits] |= uint64_t{in[x] >= 128} << (x % kWordBits);
    }
  }
  return mask;
}

Image image_from_mask(const Mask& mask) {
  Image image(mask.size(), PixelFormat::kMono8);
  for (int y = 0; y < image.size.height; ++y) {
    for (int x = 0; x < image.size.width; ++x) {
      image.row(y)[x] = mask.get(x, y) ? 255 : 0;
    }
  }
  return image;
}

double intersection_over_union(const Mask& a, const Mask& b) {
  V3D_CHECK(a.size() == b.size());
  int64_t both = 0;
  int64_t either = 0;
  for (int y = 0; y < a.size().height; ++y) {
    for (int w = 0; w < a.words_per_row(); ++w) {
      both += std::popcount(a.row(y)[w] & b.row(y)[w]);
      either += std::popcount(a.row(y)[w] | b.row(y)[w]);
    }
  }
  return either == 0 ? 1.0 : static_cast<double>(both) / static_cast<double>(either);
}

}  // namespace v3d
