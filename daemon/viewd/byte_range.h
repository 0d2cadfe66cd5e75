// The Range field of HTTP requests. Source: RFC 9110, section 14. Safe for hostile input.
#pragma once

#include <cstdint>
#include <string_view>

namespace v3d {

/// A part of a file.
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
