// The timecode of a video as other programs read it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include "base/io/child_process.h"

namespace v3d::test {

/// The tags of a video with its timecode, as ffprobe reads it from its track or its tag.
inline std::string probed_timecode(const std::filesystem::path& path) {
  const ProcessStream ffprobe({"ffprobe", "-v", "error", "-show_entries",
                               "stream=codec_tag_string:stream_tags:format_tags", path.string()},
                              ProcessStream::End::kStdout);
  std::string text;
  for (uint8_t byte = 0; ffprobe.read({&byte, 1});) text += static_cast<char>(byte);
  return text;
}

}  // namespace v3d::test
