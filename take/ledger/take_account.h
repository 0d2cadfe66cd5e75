// Writes the final account of a take: ledger.toml with the checksums of all files, and take.toml.
#pragma once

#include <string>
#include <vector>

#include "base/io/result.h"
#include "take/ledger/ledger.h"
#include "take/take.h"

namespace v3d {

/// True for a log segment of a camera of the take.
bool is_camera_log(const std::string& name, const TakeInfo& info);

/// Writes ledger.toml, then take.toml.
///
/// First adds the files of the take that `ledger.files` does not list, and reads them for their
/// checksums. Camera logs are not read, because they may be tens of gigabytes: such a log keeps the
/// checksum of the previous ledger if its length is the same, or gets none. A file that cannot be
/// read, or is larger than 4 GiB, gets no checksum; one whose length cannot be read gets no entry.
///
/// Returns one line for each file that was not read, with the cause. Fails with path and cause when
/// the ledger or take.toml cannot be written.
[[nodiscard]] io::Result<std::vector<std::string>> save_account(const TakePaths& paths,
                                                                const TakeInfo& info,
                                                                Ledger ledger);

/// Like save_account(), for programs that create a take. Throws std::runtime_error for all these
/// errors, also for a file that was not read.
void save_account_or_throw(const TakePaths& paths, const TakeInfo& info, Ledger ledger);

}  // namespace v3d
