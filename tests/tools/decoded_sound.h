// The sound of a video as a player hears it.
#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <filesystem>
#include <span>
#include <vector>

#include "base/io/child_process.h"

namespace v3d::test {

/// The first `samples` samples that ffmpeg decodes of a file at 48 kHz, left and right in turn.
inline std::vector<float> decoded_sound(const std::filesystem::path& path, int64_t samples) {
  const ProcessStream ffmpeg({"ffmpeg", "-loglevel", "error", "-i", path.string(), "-f", "f32le",
                              "-ar", "48000", "-ac", "2", "pipe:1"},
                             ProcessStream::End::kStdout);
  std::vector<float> values(2 * static_cast<size_t>(samples));
  const std::span bytes(reinterpret_cast<uint8_t*>(values.data()), values.size() * sizeof(float));
  EXPECT_TRUE(ffmpeg.read(bytes)) << path;
  return values;
}

}  // namespace v3d::test
