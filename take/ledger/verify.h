// What a take folder really holds, counted from its files.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "take/ledger/ledger.h"
#include "take/ledger/pulse_set.h"
#include "take/take.h"

namespace v3d {

struct Verification {
  TakeInfo info;
  Ledger ledger;  ///< counted anew from the logs
  /// Where files and account differ, or a file is damaged; one line each, naming the file.
  std::vector<std::string> disagreements;
  /// What a person should know and is no fault, one line each: a ledger of an older version, files
  /// that belong to no take.
  std::vector<std::string> notes;
  /// Every file of the take as it was read, with its checksum. Empty while it is recorded.
  std::vector<TakeFile> files;

  bool whole() const { return ledger.complete() && disagreements.empty(); }
};

/// The pulses of a take, counted anew: `sensed` from its log, `known` from take.toml, the rest from
/// the `stored` ledger. A take that nobody closed does not know how many pulses were commanded:
/// those that were sensed tell.
void recount_pulses(const PulseSet& sensed, int64_t known, const std::optional<Ledger>& stored,
                    Ledger& ledger);

/// Reads every event of every log, and every file for its checksum, which is compared with that of
/// the ledger. A file that differs, is missing, or is read by programs and not named in the ledger
/// is a disagreement; mesh.v3d has checksums of its own (docs/compact-frame.md). `exposed`,
/// `received` and `published` are known to the stored ledger only and taken from it where there is
/// one. Throws InputError when the folder is no take. A missing or damaged log is a disagreement,
/// and its camera misses every pulse.
Verification verify_take(const TakePaths& paths, ReadFrom from = ReadFrom::kPageCache);

/// Gives a take that nobody closed its ledger and the state "recovered". Changes no byte of a log:
/// where the whole events of a segment end is written beside it (SegmentIndex). The logs are on the
/// disk before the ledger is. Quick: of older
/// events only the labels are read, of the last ones as many as can have waited for the disk;
/// verify_take() reads the rest. Requires: nobody records into the take. Idempotent. Throws
/// InputError as verify_take() does, and std::runtime_error with path and cause when a log cannot
/// be opened or a file cannot be written; the take then stays as it is, and a later call may
/// succeed.
Verification recover_take(const TakePaths& paths);

}  // namespace v3d
