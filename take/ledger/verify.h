// Verification and recovery of takes: counts pulses and frames from the files of the take folder.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "take/ledger/ledger.h"
#include "take/logs/log_files.h"
#include "take/take.h"

namespace v3d::take {

struct Verification {
  TakeInfo info;
  Ledger ledger;  ///< counted from the logs
  /// One line for each damaged file, and for each difference between files and ledger; each names
  /// the file.
  std::vector<std::string> disagreements;
  /// Those of `disagreements` that are errors of the disk, with path and cause. The ledger then
  /// lacks pulses or frames that a later call may find.
  std::vector<std::string> read_errors;
  /// One line for each observation that is not a fault: a ledger of an older version, a log without
  /// a checksum, a damaged index of a recovery, files that do not belong to the take.
  std::vector<std::string> notes;
  /// Every file of the take with its checksum. Empty for a take that is being recorded.
  std::vector<TakeFile> files;

  bool whole() const { return ledger.complete() && disagreements.empty(); }
};

/// Evidence about the pulses of a take without a ledger.
struct PulseEvidence {
  PulseSet sensed;             ///< of pulses.lcmlog
  bool has_sense_line = true;  ///< by the studio file of the take
  int64_t known = 0;           ///< pulses by take.toml
  bool is_closed = false;      ///< by take.toml: then `known` is the number of commanded pulses
  int64_t last_labelled = -1;  ///< highest pulse of a frame that is not suspect; -1: none
};

/// Fills in the pulses of `ledger`: `sensed` from the pulse log, all else, and the absent nodes,
/// from the `stored` ledger. For a take that was not closed, the number of commanded pulses is
/// unknown. The highest sensed pulse gives the lowest possible number; without a sense line, the
/// highest pulse of a frame does.
void recount_pulses(const PulseEvidence& evidence, const std::optional<Ledger>& stored,
                    Ledger& ledger);

/// Verifies a take: reads every event of every log, and every file for its checksum, and compares
/// them with the ledger.
///
/// Disagreements are: a file that differs from the ledger or is missing; a file that programs read
/// as part of the take and the ledger does not list; a missing or damaged log, whose camera then
/// misses every pulse that cannot be read. mesh.v3d and proxy.v3d have checksums of their own
/// (docs/compact-frame.md); a proxy must have the pulses of mesh.v3d. `exposed`, `received` and
/// `published` come from the stored ledger if it exists. Throws InputError when the folder is not a
/// take.
Verification verify_take(const TakePaths& paths, ReadFrom from = ReadFrom::kPageCache);

/// What recover_take() does with a take that has read errors.
enum class AfterReadErrors : uint8_t {
  kStayOpen,  ///< writes no ledger and leaves the state, so that a later call can find more
  kRecover,   ///< an operator decided that the disk gives no more
};

/// Recovers a take that was not closed, or whose ledger cannot be read: writes its ledger and sets
/// the state "recovered". A closed take keeps ledger and state; only its indexes are renewed. A
/// recovered take whose logs hold more than its ledger, as on a disk that can be read again, is
/// counted again; its new ledger keeps the entries of all files but the logs.
///
/// Changes no byte of a log: writes the end of the last whole event of each segment beside it
/// (SegmentIndex), also where the index of an earlier recovery is damaged, and syncs the logs
/// before it writes the ledger. Reads only the labels of older events, and those last events that a
/// power cut may have damaged, and no mesh file; verify_take() reads the rest.
///
/// First frees the space that a killed daemon has reserved (TakePaths::reserve()), so that a take
/// on a full disk can be recovered. Reserves none again, also where the take stays open: a daemon
/// that continues the take reserves its own.
///
/// Requires that no process records into the take. Idempotent. Throws InputError as verify_take()
/// does, and std::runtime_error with path and cause when a log cannot be opened or a file cannot be
/// written. The state in take.toml is then unchanged, and a later call can succeed. `progress` is
/// called for each event of the camera logs, several times, for each block of sound, and for each
/// MiB of the other files.
Verification recover_take(const TakePaths& paths,
                          AfterReadErrors after = AfterReadErrors::kStayOpen,
                          const ReadProgress& progress = {});

}  // namespace v3d::take
