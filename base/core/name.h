// Names of cameras, nodes and takes become parts of file names and channels, so they must be
// harmless.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace v3d {

/// Letters, digits, '-', '_' and '.', not starting with '.' or '-', 1 to 64 characters.
bool is_file_name(std::string_view name);
inline constexpr std::string_view kFileNameRule =
    "use letters, digits, '-', '_' and '.', 64 at most, the first a letter or digit or '_'";

/// A file name that names a camera. "pulses" and names that end in a dot and four digits are taken:
/// by the log of the pulses, and by the later segments of a log ("cam07.0001.lcmlog").
bool is_camera_name(std::string_view name);
inline constexpr std::string_view kCameraNameRule =
    "use letters, digits, '-', '_' and '.', 64 at most, the first a letter or digit or '_'; not "
    "\"pulses\", and no dot and four digits at the end";

/// "cam00, cam01, ..." for a message. After 24 names the list ends with "...".
std::string join_names(const std::vector<std::string>& names);

}  // namespace v3d
