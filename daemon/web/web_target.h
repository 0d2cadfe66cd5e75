// The target and the Range field of an HTTP request, parsed. Safe for hostile input.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace v3d {

/// A request target: decoded path segments and query.
struct WebTarget {
  std::vector<std::string> path;  ///< "/takes/kendo-07" is {"takes", "kendo-07"}; "/" is empty
  std::map<std::string, std::string> query;

  /// "/takes/kendo-07"
  std::string text() const;
};

/// Decodes percent-encoding (RFC 3986) once. Empty for a target of more than 2048 bytes, without
/// leading '/', with a segment that is empty, "." or "..", or with a decoded byte that is '/', '\'
/// or not printable ASCII.
std::optional<WebTarget> parse_web_target(std::string_view target);

/// The part of a file that a Range field requests. Source: RFC 9110, section 14.
struct ByteRange {
  enum class Kind : uint8_t {
    kWhole,         ///< no range was requested, or an unsupported one: several, or malformed
    kPart,          ///< [first, first + size)
    kUnsatisfiable  ///< begins after the end of the file
  } kind = Kind::kWhole;
  int64_t first = 0;
  int64_t size = 0;
};

/// `header`: the value of the field; empty if absent. `file_size`: 0 or more. A kPart lies inside
/// the file.
ByteRange byte_range(std::string_view header, int64_t file_size);

}  // namespace v3d
