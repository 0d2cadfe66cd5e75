// verified.toml: the record of a verification, with the state of all files at that time.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/core/time.h"
#include "take/ledger/verify.h"

namespace v3d {

struct Verified {
  std::string verdict;
  bool whole = false;
  /// All files matched the ledger. Frames may be missing if the ledger lists them as missing.
  bool agrees = false;
  RealtimeInstant at;
  std::vector<TakeFile> files;  ///< every file of the take, with its checksum
};

/// Writes verified.toml with io::replace_file().
[[nodiscard]] io::Status save_verified(const TakePaths& paths, const Verification& verification);

/// Reads verified.toml and compares it with length and modification time of the current files.
/// Reads no other file.
///
/// Empty when the take was never verified; when a file was changed, removed or added since; when
/// the record cannot be read or comes from an older version without checksums. A changed slate is
/// ignored, because the crew edits it.
std::optional<Verified> load_verified(const TakePaths& paths);

/// Parses verified.toml. Throws InputError with file, line and field.
Verified parse_verified(std::string_view text, const std::filesystem::path& path);

}  // namespace v3d
