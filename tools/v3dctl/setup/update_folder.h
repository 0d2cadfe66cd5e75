// Folder of an appliance through which it is updated, reached by rsync. The appliance's program
// install-update describes the files.
#pragma once

#include <filesystem>
#include <string>

#include "v3dctl/node_folder.h"

namespace v3d::ctl {

/// The folder on the PCs of all nodes. One thread.
class UpdateFolder {
 public:
  /// `rsh`: remote shell, as of Rsync. `folder`: on each PC. `silence_s`: a request or a report of
  /// a PC that sends nothing for so many seconds is given up. Throws InputError where no scratch
  /// folder can be made in $TMPDIR.
  explicit UpdateFolder(std::string rsh, std::filesystem::path folder = "/var/lib/v3d/updates",
                        int silence_s = 20);
  ~UpdateFolder();
  UpdateFolder(const UpdateFolder&) = delete;
  UpdateFolder& operator=(const UpdateFolder&) = delete;

  /// Copies the bundle. It is on the disk of the PC when this returns.
  /// Throws std::runtime_error when rsync fails, or is interrupted by the user.
  void send_bundle(const std::string& node, const std::filesystem::path& bundle) const;
  /// Copies a request, which starts the installation. A power cut may remove it again, so it must
  /// be repeated until there is a report on it. Throws std::runtime_error when rsync fails.
  void send_request(const std::string& node, const std::string& request) const;
  /// The text of the PC's report; empty while there is none, or while the PC does not reply.
  std::string report(const std::string& node) const;

 private:
  std::string place(const std::string& node, const std::string& file) const;
  void send(const std::string& node, const std::filesystem::path& file, const std::string& name,
            std::vector<std::string> options) const;

  const Rsync rsync_;
  const std::filesystem::path folder_;
  const std::string silence_;  ///< option of rsync
  std::filesystem::path scratch_;
};

}  // namespace v3d::ctl
