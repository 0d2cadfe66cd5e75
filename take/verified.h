// verified.toml: that a take was verified, and what its files were then.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/time.h"
#include "take/verify.h"

namespace v3d {

struct VerifiedFile {
  std::string name;
  int64_t bytes = 0;
  int64_t changed_ns = 0;  ///< since 1970

  friend bool operator==(const VerifiedFile&, const VerifiedFile&) = default;
};

struct Verified {
  std::string verdict;
  bool whole = false;
  RealtimeInstant at;
  std::vector<VerifiedFile> files;  ///< what was recorded: take, ledger, calibration and logs
};

/// io::replace_file() of verified.toml.
[[nodiscard]] io::Status save_verified(const TakePaths& paths, const Verification& verification);

/// Empty when the take was never verified, or one of its files has changed since, or the record
/// cannot be read.
std::optional<Verified> load_verified(const TakePaths& paths);

/// Throws InputError with file, line and field.
Verified parse_verified(std::string_view text, const std::filesystem::path& path);

}  // namespace v3d
