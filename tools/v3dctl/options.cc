#include "v3dctl/options.h"

#include <unistd.h>

#include <algorithm>
#include <charconv>

#include "base/core/error.h"
#include "base/core/text.h"
#include "base/io/recorded_file.h"
#include "common/console.h"

namespace v3d::ctl {
namespace {

/// `value`: the option and its whole value, for the message.
int64_t parse_frame_number(std::string_view text, const std::string& value) {
  int64_t number = -1;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error != std::errc{} || end != text.data() + text.size() || number < 0) {
    throw InputError(value +
                     ": expected A:B with frame numbers from 0, such as 0:100 (frames 0 to 99)");
  }
  return number;
}

}  // namespace

take::FrameRange parse_frame_range(std::string_view text, std::string_view option) {
  take::FrameRange range;
  if (text.empty()) return range;
  const std::string value = std::string(option) + " " + std::string(text);
  const size_t colon = text.find(':');
  if (colon == std::string_view::npos) {
    range.begin = parse_frame_number(text, value);
    range.end = range.begin + 1;
    return range;
  }
  const std::string_view first = text.substr(0, colon);
  const std::string_view last = text.substr(colon + 1);
  if (first.empty() && last.empty()) parse_frame_number("", value);
  if (!first.empty()) range.begin = parse_frame_number(first, value);
  if (!last.empty()) range.end = parse_frame_number(last, value);
  if (range.begin >= range.end) {
    throw InputError(
        value +
        ": is an empty range; expected A below B, which is the first frame after the range");
  }
  return range;
}

std::vector<CameraFile> parse_camera_files(const std::vector<std::string>& values,
                                           std::string_view option) {
  std::vector<CameraFile> files;
  for (const std::string& value : values) {
    const size_t equals = value.find('=');
    if (equals == std::string::npos || equals == 0 || equals + 1 == value.size()) {
      throw InputError(std::string(option) + " " + value +
                       ": expected CAM=FILE, such as cam1=cam1/video.avi");
    }
    const std::string camera = value.substr(0, equals);
    const bool twice = std::any_of(files.begin(), files.end(),
                                   [&](const CameraFile& file) { return file.first == camera; });
    if (twice)
      throw InputError(std::string(option) + " " + value + ": " + camera +
                       " is given twice; expected each camera once");
    files.emplace_back(camera, value.substr(equals + 1));
  }
  return files;
}

std::vector<std::string> parse_names(std::string_view text, std::string_view option) {
  std::vector<std::string> names;
  while (!text.empty()) {
    const size_t comma = std::min(text.find(','), text.size());
    if (comma == 0 || comma + 1 == text.size()) {
      throw InputError(std::string(option) +
                       ": has an empty name; expected NAME,NAME,... without spaces");
    }
    names.emplace_back(text.substr(0, comma));
    text.remove_prefix(std::min(comma + 1, text.size()));
  }
  return names;
}

double parse_length_option(std::string_view text, std::string_view option) {
  try {
    return parse_length(text);
  } catch (const InputError& error) {
    throw InputError(std::string(option) + ": " + error.what());
  }
}

std::string count_of(int64_t n, const std::string& singular) {
  return format_count(n) + " " + singular + (n == 1 ? "" : "s");
}

int report_incomplete_frames(int64_t frames, const std::filesystem::path& take) {
  if (frames == 0) return kExitDone;
  note("v3dctl: a camera is missing in " + count_of(frames, "frame") + ": see v3dctl verify " +
       take.string());
  return kExitIncomplete;
}

int report_missing_index(const std::filesystem::path& file) {
  note("v3dctl: " + file.string() +
       ": has no index: it is truncated or not finished; frames may be missing");
  return kExitIncomplete;
}

void check_output(const OptionFile& output) {
  if (output.file.empty()) return;
  require_unrecorded(output.file);
  const std::string name = output.option + " " + output.file.string();
  const std::filesystem::path folder = std::filesystem::absolute(output.file).parent_path();
  if (!std::filesystem::is_directory(folder)) {
    throw InputError(name + ": its folder " + folder.string() + " does not exist");
  }
  if (std::filesystem::is_directory(output.file)) {
    throw InputError(name + ": is a folder, expected the name of a file");
  }
  if (::access(folder.c_str(), W_OK) != 0) {
    throw InputError(name + ": this user cannot write its folder " + folder.string());
  }
}

void require_other_file(const OptionFile& output, const std::vector<OptionFile>& others) {
  const auto real = [](const std::filesystem::path& file) {
    return std::filesystem::weakly_canonical(std::filesystem::absolute(file));
  };
  if (output.file.empty()) return;
  for (const OptionFile& other : others) {
    if (other.file.empty() || real(output.file) != real(other.file)) continue;
    throw InputError(output.option + " " + output.file.string() + ": is the file of " +
                     other.option + "; use another");
  }
}

void add_frames_option(cli::Command command, std::string& value) {
  command
      .add_option("--frames", value,
                  "Only these frames: A:B is A to B-1, A: is A and later, :B before B, A one frame")
      .type_name("A:B");
}

void add_json_flag(cli::Command command, bool& value) {
  command.add_flag("--json", value, "Print one JSON object on stdout and nothing else");
}

}  // namespace v3d::ctl
