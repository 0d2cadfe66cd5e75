// The end of a take's account: ledger.toml with the checksums of all files, and take.toml.
#pragma once

#include "base/io/result.h"
#include "take/ledger.h"
#include "take/take.h"

namespace v3d {

/// Writes ledger.toml, then take.toml. First completes `ledger.files` with the files of the take
/// that it does not name yet: these are read for their checksum, but for logs of cameras, which may
/// be tens of gigabytes. Such a log keeps the checksum that the ledger before had for a file of
/// this length, or is named without one. A file that cannot be read is named without a checksum.
/// Fails with path and cause.
[[nodiscard]] io::Status save_account(const TakePaths& paths, const TakeInfo& info, Ledger ledger);

}  // namespace v3d
