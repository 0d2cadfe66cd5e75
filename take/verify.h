// What a take folder really holds, counted from its files.
#pragma once

#include <string>
#include <vector>

#include "take/ledger.h"
#include "take/take.h"

namespace v3d {

struct Verification {
  TakeInfo info;
  Ledger ledger;  ///< counted anew from the logs
  /// Where files and account differ, or a file is damaged; one line each, naming the file.
  std::vector<std::string> disagreements;

  bool whole() const { return ledger.complete() && disagreements.empty(); }
};

/// Reads every event of every log. `exposed`, `received` and `published` are known to the stored
/// ledger only and taken from it where there is one. Throws InputError when the folder is no take.
/// A missing or damaged log is a disagreement, and its camera misses every pulse.
Verification verify_take(const TakePaths& paths);

/// Gives a take that nobody closed its ledger and the state "recovered". What stands behind the
/// last whole event of a log is cut off. Quick: of older events only the labels are read, as many
/// as nobody waits for a disk to have; verify_take() reads the rest. Requires: nobody records into
/// it any more. Throws as verify_take() does, and when the folder cannot be written.
Verification recover_take(const TakePaths& paths);

}  // namespace v3d
