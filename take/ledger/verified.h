// verified.toml: that a take was verified, and what its files were then.
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
  /// Nothing disagreed with the ledger; frames may be missing, if the ledger says so.
  bool agrees = false;
  RealtimeInstant at;
  std::vector<TakeFile> files;  ///< every file of the take, with its checksum
};

/// io::replace_file() of verified.toml.
[[nodiscard]] io::Status save_verified(const TakePaths& paths, const Verification& verification);

/// Empty when the take was never verified, or one of its files has another length or time of change
/// now, is missing or new, or the record cannot be read or is of an older version without
/// checksums. Reads no other file: quick. A slate that has changed does not count, since the crew
/// writes on it.
std::optional<Verified> load_verified(const TakePaths& paths);

/// Throws InputError with file, line and field.
Verified parse_verified(std::string_view text, const std::filesystem::path& path);

}  // namespace v3d
