// The Range of an HTTP request (RFC 9110, section 14). Pure; the bytes are hostile.
#pragma once

#include <cstdint>
#include <string_view>

namespace v3d {

/// A part of a file.
struct ByteRange {
  enum class Kind : uint8_t {
    kWhole,    ///< none was asked for, or one that is passed over: several, or no range at all
    kPart,     ///< [first, first + size)
    kNotThere  ///< the file ends before it
  } kind = Kind::kWhole;
  int64_t first = 0;
  int64_t size = 0;
};

/// `header` is the value of the field, empty where there is none; `file_size` at least 0. What is
/// returned lies inside the file.
ByteRange byte_range(std::string_view header, int64_t file_size);

}  // namespace v3d
