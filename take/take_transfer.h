// Joining parts of a take, comparing copies.
#pragma once

#include <string>
#include <vector>

#include "take/ledger/take_account.h"
#include "take/take.h"

namespace v3d::take {

// Joins the parts of one take, which several nodes recorded, into one take folder.

/// Joins `parts` into the new take folder `into`, and returns its take.toml. The folder of a part
/// has the name of its node.
///
/// The joined take has the cameras and background plates of all parts, the pulse log of the node
/// that sensed the most pulses, mesh.v3d and proxy.v3d of part_with_most_meshes() and one ledger
/// (merge()), and a slate with the text of all parts (join_slates()). Its motion.v3d, its earlier
/// ones and its skeletons are those of the same part, otherwise each is that of the first part that
/// has one. The ledger names the capture nodes of the take's studio file that have neither a part,
/// nor a camera or signature in another part. Files are hard-linked where the file system permits
/// it, and copied elsewhere; the parts do not change. A part of a node that only reconstructs has
/// no take.toml.
///
/// Throws InputError when no part has a take.toml, when a part has logs of cameras and no
/// take.toml, when a part contains a symbolic link, and when the parts contradict each other:
/// different names, rates or calibrations, one camera in two parts, or other times of all pulses
/// that their logs have in common. Throws std::runtime_error
/// when a file cannot be written.
TakeInfo join_parts(const std::vector<TakePaths>& parts, const TakePaths& into);

/// The files of the parts that the take `whole`, which join_parts() made of them, does not have and
/// no program makes: notes that an operator put there, and foreign_entries(). "cap01/kendo-08/",
/// "cap01/notes.txt", sorted. Throws InputError
/// when a folder cannot be read.
std::vector<std::string> files_not_joined(const std::vector<TakePaths>& parts,
                                          const TakePaths& whole);

/// The part whose mesh.v3d a joined take has.
struct MeshPart {
  const TakePaths* part = nullptr;  ///< null: no part has a mesh.v3d
  /// One line for each mesh.v3d that cannot be read, with path and cause: it may have more meshes.
  std::vector<std::string> errors;
};

/// The part whose mesh.v3d has the most meshes, the first of them when several have as many. A
/// mesh.v3d that cannot be read is chosen only when no other exists. Throws InputError when the
/// folder of a part cannot be read.
MeshPart part_with_most_meshes(const std::vector<TakePaths>& parts);

// Comparison of a take with a copy of it, before the original is deleted.

/// Compares `copy` with `original`. Returns one line for each file or entry that `copy` lacks;
/// empty when the original can be deleted without loss.
///
/// First syncs the file system of the copy, so that its files and their names survive a power cut.
/// For each file in `verified`, the record of the original's verification, reads the file of the
/// copy from disk (ReadFrom::kDisk) and compares its checksum with the record. Exceptions:
/// - take.toml and ledger.toml of a collected take are joined from those of all nodes. They are
///   read from disk too. The take's name, its cameras and the account of each camera are compared.
/// - The pulse log (all its segments, with their indexes), mesh.v3d and proxy.v3d may come from
///   another node if they contain every pulse and every mesh of the original.
/// - A skeleton may differ, because commands replace it.
/// - The slate may differ. If the original has one, the copy must have one that can be read.
/// Throws InputError when `copy` is not a take, or its file system cannot be synced.
std::vector<std::string> missing_in_copy(const TakePaths& original, const Verified& verified,
                                         const TakePaths& copy);

}  // namespace v3d::take
