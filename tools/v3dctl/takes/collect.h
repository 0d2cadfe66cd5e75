// Collects takes: copies their parts from all nodes over rsync, joins and verifies them.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "base/config/studio_file.h"
#include "take/ledger/verify.h"
#include "v3dctl/node_folder.h"

namespace v3d::ctl {

struct CollectRequest {
  std::vector<NodeFolder> sources;  ///< folders of takes
  std::filesystem::path to;         ///< folder of the copies; created if missing
  std::vector<std::string> takes;   ///< empty: all that the nodes have and `to` has not
  std::string rsh;                  ///< remote shell of rsync; empty: ssh
};

struct CollectedTake {
  std::string name;
  bool was_there = false;  ///< the copy existed; nothing was done
  std::string problem;     ///< why the take was not collected; empty: it was
  std::string meshes_of;   ///< node of the copied mesh.v3d, where several have one
  /// Of a copy that existed: its ledger. The copy is verified again when its last verification
  /// found a disagreement.
  take::Verification verification;
};

/// The nodes of the studio that have takes, accessed by node name over the remote shell. The node
/// of this PC is accessed as a folder.
std::vector<NodeFolder> sources_of(const Studio& studio);

/// Copies the parts of each take into `to`/.collect and continues copies that were interrupted.
/// Joins the parts, verifies the whole by reading it back from the disk past the page cache, and
/// renames it into `to` in one step. A copy that differs from the nodes' files is not collected. A
/// take that is being recorded is skipped, and so is one of which a source that recorded it by the
/// take's studio file has no part. Throws InputError when a node cannot be listed, or when
/// no node has a requested take. Other errors are in CollectedTake::problem; the parts then stay
/// for the next run.
std::vector<CollectedTake> collect_takes(const CollectRequest& request);

}  // namespace v3d::ctl
