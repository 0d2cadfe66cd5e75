// Option values that several commands share.
#pragma once

#include <CLI/App.hpp>
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/name_list.h"
#include "daemon/recorded/frame_range.h"

namespace v3d::ctl {

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

/// Adds the option that several commands have in common.
void add_frames_option(CLI::App* command, std::string& value);
void add_json_flag(CLI::App* command, bool& value);

}  // namespace v3d::ctl
