// Option values that several commands share.
#pragma once

#include <CLI/App.hpp>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace v3d::ctl {

/// Frames by number (the pulse, counted from 0): begin <= n < end.
struct FrameRange {
  int64_t begin = 0;
  int64_t end = std::numeric_limits<int64_t>::max();
  bool contains(int64_t frame) const { return frame >= begin && frame < end; }
  friend bool operator==(const FrameRange&, const FrameRange&) = default;
};

/// "A:B" is A to B - 1, "A:" from A on, ":B" up to B - 1, "A" that frame alone, "" all. Throws
/// InputError for anything else and for an empty range.
FrameRange parse_frame_range(std::string_view text);

/// "CAM=FILE" strings to pairs, in order. `option` names the option in messages. Throws InputError
/// for a missing part and for a camera given twice.
using CameraFile = std::pair<std::string, std::filesystem::path>;
std::vector<CameraFile> parse_camera_files(const std::vector<std::string>& values,
                                           std::string_view option);

/// "a,b,c" to its parts. Throws InputError for an empty part; "" gives none.
std::vector<std::string> parse_names(std::string_view text, std::string_view option);

/// "1 frame", "1,250 frames".
std::string count_of(int64_t n, const std::string& singular);

/// For messages: "cam00, cam01, ..." cut after two dozen.
std::string join_names(const std::vector<std::string>& names);

/// Adds the option that several commands have in common.
void add_frames_option(CLI::App* command, std::string& value);
void add_json_flag(CLI::App* command, bool& value);

}  // namespace v3d::ctl
