// Validation of the names of cameras, nodes and takes, which become parts of file names and
// channels.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace v3d {

/// True for 1 to 64 letters, digits, '-', '_' and '.' that do not start with '.' or '-'.
bool is_file_name(std::string_view name);
inline constexpr std::string_view kFileNameRule =
    "use letters, digits, '-', '_' and '.', at most 64 characters; start with a letter, a digit or "
    "'_'";

/// True for a file name that a camera may have.
/// Reserved: "pulses" (the log of the pulses), and names that end in a dot and four digits (later
/// segments of a log, "cam07.0001.lcmlog").
bool is_camera_name(std::string_view name);
inline constexpr std::string_view kCameraNameRule =
    "use letters, digits, '-', '_' and '.', at most 64 characters; start with a letter, a digit or "
    "'_'; do not use \"pulses\", nor a dot and four digits at the end";

/// "cam00, cam01, ...": the first 24 names; "..." replaces the others.
std::string join_names(const std::vector<std::string>& names);

}  // namespace v3d
