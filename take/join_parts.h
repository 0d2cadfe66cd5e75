// Joins the parts of one take, which several nodes recorded, into one take folder.
#pragma once

#include <string>
#include <vector>

#include "take/take.h"

namespace v3d {

/// Joins `parts` into the new take folder `into`, and returns its take.toml. The folder of a part
/// has the name of its node.
///
/// The joined take has the cameras and background plates of all parts, the pulse log of the node
/// that sensed the most pulses, the meshes of part_with_most_meshes() and one ledger (merge()).
/// The ledger names the capture nodes of the take's studio file that have neither a part, nor a
/// camera or signature in another part.
/// Files are hard-linked where the file system permits it, and copied elsewhere; the parts do not
/// change. A part of a node that only reconstructs has no take.toml.
///
/// Throws InputError when no part has a take.toml, when a part has logs of cameras and no
/// take.toml, when a part contains a symbolic link, and when the parts contradict each other:
/// different names, rates or calibrations, or one camera in two parts. Throws std::runtime_error
/// when a file cannot be written.
TakeInfo join_parts(const std::vector<TakePaths>& parts, const TakePaths& into);

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

}  // namespace v3d
