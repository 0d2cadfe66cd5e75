#include "daemon/viewd/byte_range.h"

#include <algorithm>
#include <charconv>
#include <optional>

namespace v3d {
namespace {

/// A number of decimal digits only.
std::optional<int64_t> number(std::string_view text) {
  int64_t value = 0;
  const char* end = text.data() + text.size();
  const auto parsed = std::from_chars(text.data(), end, value);
  const bool whole = !text.empty() && text.front() != '-' && parsed.ec == std::errc();
  return whole && parsed.ptr == end ? std::optional(value) : std::nullopt;
}

ByteRange part(int64_t first, int64_t size) {
  return {size > 0 ? ByteRange::Kind::kPart : ByteRange::Kind::kUnsatisfiable, first, size};
}

}  // namespace

ByteRange byte_range(std::string_view header, int64_t file_size) {
  const ByteRange whole{.kind = ByteRange::Kind::kWhole, .first = 0, .size = file_size};
  constexpr std::string_view kUnit = "bytes=";
  if (!header.starts_with(kUnit)) return whole;
  header.remove_prefix(kUnit.size());
  const size_t dash = header.find('-');
  if (dash == std::string_view::npos) return whole;
  const auto first = number(header.substr(0, dash));
  const auto last = number(header.substr(dash + 1));
  if (dash == 0) {  // "-500": the last 500 bytes
    if (!last) return whole;
    const int64_t size = std::min(*last, file_size);
    return part(file_size - size, size);
  }
  const bool open = dash + 1 == header.size();  // "500-": from there to the end
  if (!first || (!open && (!last || *last < *first))) return whole;
  if (*first >= file_size) return part(0, 0);
  const int64_t end = open ? file_size - 1 : std::min(*last, file_size - 1);
  return part(*first, end - *first + 1);
}

}  // namespace v3d
