// The end of a take's account: ledger.toml with the checksums of all files, and take.toml.
#pragma once

#include <string>
#include <vector>

#include "base/io/result.h"
#include "take/ledger/ledger.h"
#include "take/take.h"

namespace v3d {

/// Whether `name` is a segment of the log of a camera of the take.
bool is_camera_log(const std::string& name, const TakeInfo& info);

/// Writes ledger.toml, then take.toml. First completes `ledger.files` with the files of the take
/// that it does not name yet: these are read for their checksum, but for logs of cameras, which may
/// be tens of gigabytes. Such a log keeps the checksum that the ledger before had for a file of
/// this length, or is named without one. A file that cannot be read, or has more than 4 GiB, is
/// named without a checksum. Returns why it could not, one line each. Fails with path and cause
/// when nothing was written.
[[nodiscard]] io::Result<std::vector<std::string>> save_account(const TakePaths& paths,
                                                                const TakeInfo& info,
                                                                Ledger ledger);

/// The same for programs that make a take: throws std::runtime_error for all of that.
void save_whole_account(const TakePaths& paths, const TakeInfo& info, Ledger ledger);

}  // namespace v3d
