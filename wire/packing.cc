#include "wire/packing.h"

#include <array>
#include <cstring>

#include "base/core/bytes.h"

namespace v3d::wire {
namespace {

class Walker {
 public:
  explicit Walker(std::span<const uint8_t> body) : body_(body) {}

  size_t position() const { return position_; }
  bool at_end() const { return position_ == body_.size(); }

  /// Checks and skips one field. `index`: position of the count of an array.
  bool step(char kind, size_t index) {
    switch (kind) {
      case 'q':
        return skip(8);
      case 'i':
        return skip(4);
      case 'b':
        return skip(1);
      case '?':
        return boolean();
      case 'm':
        return skip(32);
      case 's':
        return string();
      case 'n':
        return count();
      case 'B':
        return skip(counts_[index]);
      case 'S':
        return strings(counts_[index]);
      case 'D':
        return counts_[index] <= remaining() / 8 && skip(counts_[index] * 8);
      default:
        return false;
    }
  }

 private:
  size_t remaining() const { return body_.size() - position_; }

  bool skip(size_t n) {
    if (n > remaining()) return false;
    position_ += n;
    return true;
  }

  bool boolean() {
    if (remaining() < 1 || body_[position_] > 1) return false;
    return skip(1);
  }

  std::optional<size_t> length() {
    if (remaining() < 4) return std::nullopt;
    const uint64_t n = read_big_endian(body_.subspan(position_, 4));
    if (n > INT32_MAX) return std::nullopt;
    position_ += 4;
    return n;
  }

  bool count() {
    const auto n = length();
    if (!n || count_number_ == counts_.size()) return false;
    counts_[count_number_++] = *n;
    return true;
  }

  bool string() {
    const auto n = length();
    if (!n || *n == 0 || *n > remaining()) return false;
    const void* nul = std::memchr(body_.data() + position_, 0, *n);
    return nul == body_.data() + position_ + *n - 1 && skip(*n);
  }

  bool strings(size_t n) {
    if (n > remaining() / 5) return false;  // a string has at least 5 bytes
    for (size_t i = 0; i < n; ++i) {
      if (!string()) return false;
    }
    return true;
  }

  std::span<const uint8_t> body_;
  size_t position_ = 0;
  std::array<size_t, 4> counts_{};
  size_t count_number_ = 0;
};

/// Checks the fields of `layout` in order. Stops before the first field of kind `stop`.
bool walk(Walker& walker, Layout layout, char stop = 0) {
  for (size_t i = 0; i < layout.size(); ++i) {
    const char kind = layout[i];
    if (kind == stop) return true;
    const bool array = kind == 'B' || kind == 'S' || kind == 'D';
    const size_t index = array ? static_cast<size_t>(layout[++i] - '0') : 0;
    if (!walker.step(kind, index)) return false;
  }
  return true;
}

}  // namespace

bool fits(Layout layout, std::span<const uint8_t> body) {
  Walker walker(body);
  return walk(walker, layout) && walker.at_end();
}

std::optional<size_t> bytes_before_arrays(Layout layout, std::span<const uint8_t> body) {
  Walker walker(body);
  if (!walk(walker, layout, 'B')) return std::nullopt;
  return walker.position();
}

}  // namespace v3d::wire
