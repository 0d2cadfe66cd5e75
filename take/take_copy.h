// Comparison of a take with its copy elsewhere, before the take is deleted.
#pragma once

#include <string>
#include <vector>

#include "take/ledger/verified.h"
#include "take/take.h"

namespace v3d {

/// What `copy` lacks of `original`, one line each; empty when deleting the original loses nothing.
///
/// Every file of the copy that the original has is read from its disk (ReadFrom::kDisk) and
/// compared with the checksum in `verified`, the record of the original's verification. Exceptions:
/// take.toml and ledger.toml of a collected take are joined from those of all nodes, so only its
/// name and its cameras are compared; pulses.lcmlog and mesh.v3d may be those of another node when
/// they have every pulse and every mesh of the original; the slate is not compared. Throws
/// InputError when `copy` is no take.
std::vector<std::string> missing_in_copy(const TakePaths& original, const Verified& verified,
                                         const TakePaths& copy);

}  // namespace v3d
