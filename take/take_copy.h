// Comparison of a take with a copy of it, before the original is deleted.
#pragma once

#include <string>
#include <vector>

#include "take/ledger/verified.h"
#include "take/take.h"

namespace v3d {

/// Compares `copy` with `original`. Returns one line for each file or entry that `copy` lacks;
/// empty when the original can be deleted without loss.
///
/// First syncs the file system of the copy, so that its files and their names survive a power cut.
/// For each file in `verified`, the record of the original's verification, reads the file of the
/// copy from disk (ReadFrom::kDisk) and compares its checksum with the record. Exceptions:
/// - take.toml and ledger.toml of a collected take are joined from those of all nodes. They are
/// read
///   from disk too. The take's name, its cameras and the account of each camera are compared.
/// - pulses.lcmlog and mesh.v3d may come from another node if they contain every pulse and every
///   mesh of the original.
/// - The slate may differ. If the original has one, the copy must have one that can be read.
/// Throws InputError when `copy` is not a take, or its file system cannot be synced.
std::vector<std::string> missing_in_copy(const TakePaths& original, const Verified& verified,
                                         const TakePaths& copy);

}  // namespace v3d
