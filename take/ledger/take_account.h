// Final account and verification record.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/core/time.h"
#include "base/io/file.h"
#include "take/ledger/ledger.h"
#include "take/ledger/verify.h"
#include "take/take.h"

namespace v3d::take {

// Writes the final account of a take: ledger.toml with the checksums of all files, and take.toml.

/// True for a log segment of a camera of the take.
bool is_camera_log(const std::string& name, const TakeInfo& info);

/// The names of the files without a checksum in the ledger of a take, without camera logs, whose
/// frames have checksums: sound of more than 4 GiB, for example. Throws as load_ledger().
std::vector<std::string> files_without_checksum(const TakePaths& paths);

/// Writes ledger.toml, then take.toml.
///
/// First adds the files of the take that `ledger.files` does not list, and reads them for their
/// checksums. Camera logs are not read, because they may be tens of gigabytes: such a log keeps the
/// checksum of the previous ledger if its length is the same, or gets none. A file that cannot be
/// read, or is larger than 4 GiB, gets no checksum; one whose length cannot be read gets no entry.
///
/// Returns one line for each file that was not read, with the cause, except for sound of more than
/// 4 GiB. Fails with path and cause when the ledger or take.toml cannot be written. `progress`:
/// called before each MiB is read, because sound may take half a minute.
[[nodiscard]] io::Result<std::vector<std::string>> save_account(const TakePaths& paths,
                                                                const TakeInfo& info, Ledger ledger,
                                                                const ReadProgress& progress = {});

/// Like save_account(), for programs that create a take. Throws std::runtime_error for all these
/// errors, also for a file that was not read.
void save_account_or_throw(const TakePaths& paths, const TakeInfo& info, Ledger ledger);

// verified.toml: the record of a verification, with the state of all files at that time.

struct Verified {
  std::string verdict;
  bool whole = false;
  /// All files matched the ledger. Frames may be missing if the ledger lists them as missing.
  bool agrees = false;
  /// A disagreement that another check than that of the files found, as of signatures or images.
  /// Empty: none, or not checked.
  std::string other_disagreement;
  RealtimeInstant at;
  std::vector<TakeFile> files;  ///< every file of the take, with its checksum
};

/// Writes verified.toml with io::replace_file(). `other_disagreement`: see Verified.
[[nodiscard]] io::Status save_verified(const TakePaths& paths, const Verification& verification,
                                       const std::string& other_disagreement = {});

/// Reads verified.toml and compares it with length and modification time of the current files.
/// Reads no other file.
///
/// Empty when the take was never verified; when a file was changed, removed or added since; when
/// the record cannot be read or comes from an older version without checksums. A changed slate is
/// ignored, because the crew edits it.
std::optional<Verified> load_verified(const TakePaths& paths);

/// Parses verified.toml. Throws InputError with file, line and field.
Verified parse_verified(std::string_view text, const std::filesystem::path& path);

}  // namespace v3d::take
