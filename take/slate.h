// slate.toml: the crew's notes about a take. People and tools write it after the recording. A take
// without this file has an empty slate.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

#include "base/io/result.h"

namespace v3d {

enum class Mark : uint8_t { kNone, kCircled, kRejected };
/// "", "circled", "rejected"
std::string_view name(Mark mark);

struct Slate {
  std::string scene;
  std::string take;
  std::string note;
  Mark mark = Mark::kNone;

  /// All fields in one line without control characters: "scene 12, take 3, circled, the sword
  /// slips". Empty for an empty slate.
  std::string text() const;
  friend bool operator==(const Slate&, const Slate&) = default;
};

/// Reads slate.toml. Returns an empty slate when the file does not exist. Throws InputError with
/// file, line and field.
Slate load_slate(const std::filesystem::path& path);
Slate parse_slate(std::string_view text, const std::filesystem::path& path);
/// Writes slate.toml with io::replace_file().
[[nodiscard]] io::Status save_slate(const std::filesystem::path& path, const Slate& slate);

}  // namespace v3d
