// Creates, reopens, closes and recovers the folder of a take on this node.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "base/config/studio_file.h"
#include "take/ledger/ledger.h"
#include "take/take.h"
#include "take/take_lock.h"

namespace v3d {

/// The paths of a take of this studio. The folder need not exist.
TakePaths take_paths(const Studio& studio, const std::string& take);

/// Throws InputError when the name is not a file name, or is reserved: for a check, for learning
/// the background, or for the quarantine.
void check_take_name(const std::string& take);

/// check_take_name(); also throws InputError when the take exists already, or its folder has logs
/// without a take.toml.
void check_new_take(const Studio& studio, const std::string& take);

/// Creates the folder with take.toml (state: recording), calib.toml, studio.toml and background/.
/// All of it survives a power cut when the function returns. Throws InputError naming the file that
/// could not be written.
void create_take(const Studio& studio, const TakeInfo& info);

/// Sets the state of a take to recording again. Call before anything is added to the take. Throws
/// InputError with path and cause.
TakeInfo reopen_take(const TakePaths& paths);

/// Locks a take for recording by `node`. Creates the folder if necessary. Throws InputError while
/// another process holds the lock, and when the lock file cannot be created. Logs a warning where
/// the file system does not support locks.
TakeLock lock_take(const TakePaths& paths, const std::string& node);

/// Recovers a take that could not be resumed: writes its ledger and state. Does nothing while
/// another process records into it. Errors are logged; the next start of the daemon tries again.
void recover_reopened_take(const TakePaths& paths, const std::string& node);

/// Writes the ledger and the final take.toml. Returns false, and logs the error, when the disk
/// reports one; also when a file of the ledger cannot be read for its checksum.
bool close_take(const Studio& studio, TakeInfo info, const Ledger& ledger);

struct RecoveredTake {
  std::string line;              ///< result, for the log
  std::optional<Ledger> ledger;  ///< empty when the take could not be recovered
};
/// Recovers takes of these cameras that a crash left open: writes their ledgers and sets their
/// state to recovered. Skips a take that another process records into as `node`; its line says so.
std::vector<RecoveredTake> recover_open_takes(const Studio& studio, const std::string& node,
                                              const std::vector<std::string>& cameras);

/// Free bytes of the disk that has the takes; 0 when they cannot be read.
double disk_free_bytes(const Studio& studio);

}  // namespace v3d
