// The order of files with numbers in their names.
#pragma once

#include <cstring>
#include <filesystem>

namespace v3d {

/// Orders paths by name, numbers in names by value: scan_2.obj before scan_10.obj.
inline bool is_before_by_numbers(const std::filesystem::path& a, const std::filesystem::path& b) {
  return strverscmp(a.c_str(), b.c_str()) < 0;
}

}  // namespace v3d
