// Folders of takes and their locks.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "base/config/studio_file.h"
#include "base/io/file.h"
#include "base/io/unique_fd.h"
#include "take/ledger/ledger.h"
#include "take/take.h"
#include "take/take_lock.h"
#include "wire/messages.h"

namespace v3d::node {

// Creates, reopens, closes and recovers the folder of a take on this node.

/// The paths of a take of this studio. The folder need not exist.
take::TakePaths take_paths(const Studio& studio, const std::string& take);

/// control::check_take_name(); also throws InputError when the take exists already, or its folder
/// has logs without a take.toml.
void check_new_take(const Studio& studio, const std::string& take);

/// Creates the folder with take.toml (state: recording), calib.toml, studio.toml and background/.
/// All of it survives a power cut when the function returns. Throws InputError naming the file that
/// could not be written.
void create_take(const Studio& studio, const take::TakeInfo& info);

/// Sets the state of a take to recording again. Call before anything is added to the take. Throws
/// InputError with path and cause.
take::TakeInfo reopen_take(const take::TakePaths& paths);

/// Locks a take for recording by `node`. Creates the folder if necessary. Throws InputError while
/// another process holds the lock, and when the lock file cannot be created. Logs a warning where
/// the file system does not support locks.
take::TakeLock lock_take(const take::TakePaths& paths, const std::string& node);

/// Writes the ledger, and take.toml with this state: kRecording for a take that a recovery must
/// count again. Returns one line with path and cause for each file that could not be read, whose
/// checksum the ledger lacks; the take is closed all the same. Fails with one line that names the
/// take, the path and the cause when the ledger cannot be written. Reports its progress to systemd,
/// because gigabytes of sound may be read for their checksum.
[[nodiscard]] io::Result<std::vector<std::string>> close_take(
    const Studio& studio, take::TakeInfo info, const take::Ledger& ledger,
    take::TakeState state = take::TakeState::kComplete);

/// Moves a take to the quarantine (take/take_removal.h) after its arming failed, so that its name
/// is free again. Logs the result.
void quarantine_unarmed_take(const take::TakePaths& paths);

/// Whether a node with these cameras must recover a take: it is in state recording, and it was
/// recorded by one of them or by the command that the node has persisted in its folder
/// (`has_command`). A node that has the trigger and no camera also recovers takes without cameras.
bool is_open_take_of(const take::TakeInfo& info, const std::vector<std::string>& cameras,
                     bool has_command);

struct RecoveredTake {
  std::string line;                    ///< result, for the log
  std::optional<take::Ledger> ledger;  ///< empty when the take could not be recovered
};
/// Recovers the takes of `node`, which has these cameras, that a crash left open
/// (is_open_take_of()): writes their ledgers and sets their state to recovered. Skips a take that
/// another process records into as `node`; its line says so, and so does the line of a folder with
/// logs and no take.toml. Reports its progress to systemd.
std::vector<RecoveredTake> recover_open_takes(const Studio& studio, const std::string& node,
                                              const std::vector<std::string>& cameras);

/// Free bytes of the disk that has the takes. Fails with path and cause.
[[nodiscard]] io::Result<double> disk_free_bytes(const Studio& studio);
/// Adds the value disk_free_bytes to the health of a node. Where it cannot be read, there is no
/// value, and the text has the cause unless it reports something else.
void report_free_space(const io::Result<double>& free_bytes, wire::HealthMessage& health);

// Exclusive lock of a daemon on a folder (flock).

/// Holds the lock file `folder`/`name`. The kernel releases it when the process ends, also when it
/// is killed. Any thread.
class FolderLock {
 public:
  /// Creates the folder if necessary. `owner` is written into the lock file, for the error message
  /// of other processes. Throws InputError when another process holds the lock, or the file cannot
  /// be opened.
  FolderLock(const std::filesystem::path& folder, const std::string& name,
             const std::string& owner);

 private:
  io::UniqueFd file_;
};

}  // namespace v3d::node
