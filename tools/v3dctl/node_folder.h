// Folders on the PCs of nodes, reached by rsync over the remote shell.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "base/config/studio_file.h"
#include "base/io/child_process.h"

namespace v3d::ctl {

/// A node and a folder on its PC in the syntax of rsync: a folder, or "cap01:/var/lib/v3d/takes".
struct NodeFolder {
  std::string node;
  std::string place;
};

/// `folder` on the PC of `node`. The node of this PC is accessed as a folder.
NodeFolder node_folder(const std::string& node, const std::filesystem::path& folder);

/// Calls rsync. Thread-safe.
class Rsync {
 public:
  /// `rsh`: remote shell of rsync; empty: that of $RSYNC_RSH, else ssh, which ends when the other
  /// PC does not reply for 30 s.
  explicit Rsync(std::string rsh) : rsh_(std::move(rsh)) {}

  /// Runs rsync --times with these options and paths. Throws InputError where rsync is missing.
  ProcessResult run(const std::vector<std::string>& options, const std::vector<std::string>& paths,
                    Output output) const;

 private:
  const std::string rsh_;
};

}  // namespace v3d::ctl
