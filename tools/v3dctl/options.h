// Option values and messages that several commands share.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/core/text.h"
#include "cli/command.h"
#include "take/take.h"

namespace v3d::ctl {

/// Parses a range of frame numbers: "A:B" is A to B - 1, "A:" is A and later, ":B" is before B, "A"
/// is one frame, "" is all frames. `option`: its name, for messages. Throws InputError for other
/// text and for an empty range.
take::FrameRange parse_frame_range(std::string_view text, std::string_view option = "--frames");

using CameraFile = std::pair<std::string, std::filesystem::path>;
/// Splits "CAM=FILE" values into pairs and keeps their order. `option`: its name, for messages.
/// Throws InputError when a part is missing or a camera is given twice.
std::vector<CameraFile> parse_camera_files(const std::vector<std::string>& values,
                                           std::string_view option);

/// Splits "a,b,c" at the commas; "" has no parts. Throws InputError for an empty part.
std::vector<std::string> parse_names(std::string_view text, std::string_view option);

/// parse_length() of the value of `option`, or of a part of it; the message of InputError begins
/// with the option.
double parse_length_option(std::string_view text, std::string_view option);

/// Number and noun: "1 frame", "1,250 frames".
std::string count_of(int64_t n, const std::string& singular);

/// Reports on stderr how many `frames` of the take are incomplete: a camera has no frame there, or
/// its frame cannot be read. Returns kExitDone where there are none, otherwise kExitIncomplete.
int report_incomplete_frames(int64_t frames, const std::filesystem::path& take);

/// Reports on stderr that the mesh file has no index. Returns kExitIncomplete.
int report_missing_index(const std::filesystem::path& file);

/// The value of an option that names a file; an empty file: the option is not given.
struct OptionFile {
  std::string option;  ///< "--out"
  std::filesystem::path file;
};

/// Throws InputError where the file could not be written after the work, because it is a folder or
/// a recorded file, or its folder does not exist or cannot be written. Does nothing for an option
/// that is not given.
void check_output(const OptionFile& output);

/// Throws InputError where `output` names the file of one of `others`, and would replace it.
void require_other_file(const OptionFile& output, const std::vector<OptionFile>& others);

void add_frames_option(cli::Command command, std::string& value);
void add_json_flag(cli::Command command, bool& value);

}  // namespace v3d::ctl
