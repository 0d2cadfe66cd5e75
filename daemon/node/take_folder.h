// Makes and closes the folder of a take on this node.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "base/studio_file.h"
#include "take/ledger/ledger.h"
#include "take/take.h"
#include "take/take_lock.h"

namespace v3d {

/// Where a take of this studio lies.
TakePaths take_paths(const Studio& studio, const std::string& take);

/// Throws InputError when the name cannot be a take's: it is no file name, or stands for what is
/// armed for a check or to learn the background.
void refuse_take_name(const std::string& take);

/// The same, and when the take exists already or its folder holds logs without a take.toml.
void refuse_bad_take(const Studio& studio, const std::string& take);

/// Makes the folder with take.toml (state: recording), calib.toml, studio.toml and background/.
/// When it returns, all of this survives a power cut. Throws InputError naming what could not be
/// made.
void create_take(const Studio& studio, const TakeInfo& info);

/// Marks a take as being recorded again, before anything more is recorded into it. Throws
/// InputError with path and cause.
TakeInfo reopen_take(const TakePaths& paths);

/// The lock of a node on a take that it is about to record into. Makes the folder where there is
/// none. Throws InputError while another process holds it, and when the lock file cannot be made.
/// Where the file system knows no locks, a warning is logged.
TakeLock lock_take(const TakePaths& paths, const std::string& node);

/// Gives a take that could not be continued the ledger and state of a recovered one, unless another
/// process records into it. A failure is logged; the next start of the daemon tries again.
void close_reopened_take(const TakePaths& paths, const std::string& node);

/// Writes the ledger and the final take.toml. False, and logged, when the disk reports an error,
/// also when it does not give a file that the ledger names with its checksum.
bool close_take(const Studio& studio, TakeInfo info, const Ledger& ledger);

struct RecoveredTake {
  std::string line;              ///< for a person
  std::optional<Ledger> ledger;  ///< empty when it could not be recovered
};
/// Gives takes of these cameras that a crash left open their ledger and the state "recovered". A
/// take that another process records into as `node` is left alone; its line says so.
std::vector<RecoveredTake> recover_open_takes(const Studio& studio, const std::string& node,
                                              const std::vector<std::string>& cameras);

/// Bytes that can still be written where takes lie; 0 when that cannot be told.
double disk_free_bytes(const Studio& studio);

}  // namespace v3d
