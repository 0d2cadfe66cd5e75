// slate.toml: what the crew says of a take. Written by people's hands and tools after the
// recording; a take without one has an empty slate.
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

  /// "scene 12, take 3, circled, the sword slips", one line without control characters; empty for
  /// an empty slate.
  std::string text() const;
  friend bool operator==(const Slate&, const Slate&) = default;
};

/// The empty slate when there is no file. Throws InputError with file, line and field.
Slate load_slate(const std::filesystem::path& path);
Slate parse_slate(std::string_view text, const std::filesystem::path& path);
/// io::replace_file() of slate.toml.
[[nodiscard]] io::Status save_slate(const std::filesystem::path& path, const Slate& slate);

}  // namespace v3d
