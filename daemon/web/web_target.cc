#include "daemon/web/web_target.h"

#include <algorithm>
#include <charconv>
#include <optional>

namespace v3d {
namespace {

constexpr size_t kLongest = 2048;

/// Empty for a '%' without two hexadecimal digits, and for bytes that are not printable ASCII.
std::optional<std::string> decoded(std::string_view text) {
  std::string plain;
  for (size_t i = 0; i < text.size(); ++i) {
    unsigned char c = static_cast<unsigned char>(text[i]);
    if (c == '%') {
      const std::string_view digits = text.substr(i + 1, 2);
      const char* end = digits.data() + digits.size();
      const auto parsed = std::from_chars(digits.data(), end, c, 16);
      if (digits.size() != 2 || parsed.ec != std::errc() || parsed.ptr != end) return {};
      i += 2;
    }
    if (c < 0x20 || c > 0x7e) return {};
    plain += static_cast<char>(c);
  }
  return plain;
}

bool is_harmless(const std::string& segment) {
  return !segment.empty() && segment != "." && segment != ".." &&
         segment.find_first_of("/\\") == std::string::npos;
}

/// Calls `part` for each part between separators, until it returns false.
template <class Part>
bool each_part(std::string_view text, char separator, Part part) {
  while (true) {
    const size_t end = text.find(separator);
    if (!part(text.substr(0, end))) return false;
    if (end == std::string_view::npos) return true;
    text.remove_prefix(end + 1);
  }
}

bool read_path(std::string_view text, WebTarget& target) {
  if (text.empty()) return true;
  return each_part(text, '/', [&](std::string_view part) {
    auto segment = decoded(part);
    if (!segment || !is_harmless(*segment)) return false;
    target.path.push_back(std::move(*segment));
    return true;
  });
}

bool read_query(std::string_view text, WebTarget& target) {
  return each_part(text, '&', [&](std::string_view part) {
    const size_t equals = part.find('=');
    const auto name = decoded(part.substr(0, equals));
    const auto value = decoded(equals == std::string_view::npos ? "" : part.substr(equals + 1));
    if (!name || !value) return false;
    target.query[*name] = *value;
    return true;
  });
}

}  // namespace

std::string WebTarget::text() const {
  std::string text;
  for (const std::string& segment : path) text += "/" + segment;
  return text.empty() ? "/" : text;
}

std::optional<WebTarget> parse_web_target(std::string_view target) {
  if (target.size() > kLongest || !target.starts_with('/')) return {};
  WebTarget parsed;
  const size_t question = target.find('?');
  if (!read_path(target.substr(1, question == std::string_view::npos ? question : question - 1),
                 parsed)) {
    return {};
  }
  if (question == std::string_view::npos) return parsed;
  if (!read_query(target.substr(question + 1), parsed)) return {};
  return parsed;
}

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
