// Brings the takes of a studio together: from the nodes that recorded them to one place, over
// rsync.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "base/studio_file.h"
#include "take/verify.h"

namespace v3d::ctl {

/// Where the takes of a node lie, as rsync understands it: "cap01:/var/lib/v3d/takes", or a folder.
struct TakeSource {
  std::string node;
  std::string place;
};

struct CollectRequest {
  std::vector<TakeSource> sources;
  std::filesystem::path to;        ///< folder of takes; made
  std::vector<std::string> takes;  ///< empty: all that the nodes have and `to` has not
  std::string rsh;                 ///< rsync's remote shell; empty: ssh
};

struct CollectedTake {
  std::string name;
  bool was_there = false;  ///< already; nothing was done
  std::string problem;     ///< why it is not there yet; empty: it is
  std::string meshes_of;   ///< the node whose mesh.v3d it has, where several have one
  Verification verification;
};

/// The nodes of the studio that have takes, each by its name and with the studio's folder; the node
/// that this PC is by the folder alone.
std::vector<TakeSource> sources_of(const Studio& studio);

/// Copies what every node has of a take (rsync compares checksums of what it sent, goes on where it
/// was cut off, and leaves alone what is there), puts the parts together, verifies the whole by
/// reading it back from the disk past the page cache, and gives it its place in one step. A copy
/// that is not what the nodes have is not collected. What is not whole yet stays in TO/.collect,
/// for the next time. A take that a node still records is passed over. Throws InputError when a
/// node cannot be asked, or has no such take.
std::vector<CollectedTake> collect_takes(const CollectRequest& request);

}  // namespace v3d::ctl
