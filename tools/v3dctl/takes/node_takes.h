// The takes of a node, with the content of their take.toml and ledger.toml.
#pragma once

#include <filesystem>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "take/ledger/ledger.h"
#include "take/take.h"
#include "v3dctl/node_folder.h"

namespace v3d::ctl {

/// Entries of the folder of takes of a node.
struct NodeTakes {
  std::set<std::string> takes;      ///< takes with a take.toml, a log or a mesh.v3d
  std::set<std::string> recorded;   ///< those with a take.toml
  std::set<std::string> with_logs;  ///< those with a log of a camera or of the pulses
  /// Folders with a take.toml, a log or a mesh.v3d whose names are no names of takes.
  std::set<std::string> odd_names;
  /// Symbolic links to no folder: the disk of their target may not be mounted.
  std::set<std::string> broken_links;
  /// The folder has the entry `probe`, so it is the folder in which the caller created it.
  bool has_probe = false;
};

/// Lists the folder of takes of a node. A symbolic link to the folder of a take is a take, because
/// operators move takes to other disks. `probe`: a path relative to the folder. Throws InputError
/// when the folder cannot be listed.
NodeTakes list_node_takes(const Rsync& rsync, const NodeFolder& source,
                          const std::filesystem::path& probe);

/// take.toml and ledger.toml of a take, or of the part of a node.
struct TakeSummary {
  take::TakeInfo info;
  std::optional<take::Ledger> ledger;  ///< empty: it cannot be read
};

/// Reads take.toml and ledger.toml. Throws InputError when take.toml cannot be read.
TakeSummary read_summary(const take::TakePaths& paths);

/// Copies take.toml, ledger.toml and slate.toml of these takes of a node to INTO/TAKE. A file that
/// rsync cannot read is missing there. Throws InputError when the node cannot be read at all.
void fetch_summaries(const Rsync& rsync, const NodeFolder& source,
                     const std::set<std::string>& takes, const std::filesystem::path& into);

/// Why `copy` in the folder `place` is no copy of `part`, which `node` has; empty: it is one.
///
/// The start in take.toml decides, which a collected take has from one of its parts. The other
/// parts have a start of their own, by the clock of their node, which may be wrong. For them, a log
/// of a camera with the same checksum decides; without one, a start that differs by less than a
/// minute. A copy is not whole when the ledger of the part has cameras, segments of their logs,
/// sound files, bytes, frames or pulses that its own lacks.
std::string difference_from_copy(const TakeSummary& part, const std::string& node,
                                 const TakeSummary& copy, const std::filesystem::path& place);

/// A line with what the crew wrote on the slate of `part`, on its node, and the slate of `copy`
/// lacks: "cap01/slate.toml: has ...". Empty when it lacks nothing.
std::string slate_note(const take::TakePaths& part, const std::string& node,
                       const take::TakePaths& copy);

}  // namespace v3d::ctl
