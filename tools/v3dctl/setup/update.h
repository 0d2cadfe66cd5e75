// Update of appliances: copies a bundle to the PC of each node, has it installed, and waits for the
// new system.
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/core/time.h"
#include "v3dctl/node_folder.h"
#include "wire/messages.h"

namespace v3d::ctl {

/// What the PC of a node reports about the installation (result.json of the appliance's program
/// install-update).
struct InstallReport {
  enum class State { kChecking, kInstalling, kWaiting, kRestarting, kRefused, kFailed };
  State state = State::kChecking;
  std::string version;  ///< of the bundle; empty before its signature is verified
  std::string message;  ///< one line, or empty
};

/// Maximum size of a report, bytes.
inline constexpr size_t kMaxInstallReportBytes = 1 << 16;

/// Parses a report. Empty where the text is no report on the request with this number: an earlier
/// one, or damaged. Any bytes are allowed.
std::optional<InstallReport> parse_install_report(std::string_view json,
                                                  const std::string& request);

/// Connection to the studio's nodes. One thread.
class UpdateLink {
 public:
  UpdateLink() = default;
  virtual ~UpdateLink() = default;
  UpdateLink(const UpdateLink&) = delete;
  UpdateLink& operator=(const UpdateLink&) = delete;

  /// The last health of each node that has sent one in the last seconds.
  virtual std::map<std::string, wire::HealthMessage> health() = 0;
  /// Copies the bundle to the PC of the node, then the request, which starts the installation. The
  /// PC obeys a repeated request once. Throws std::runtime_error when that fails.
  virtual void send_bundle(const std::string& node, const std::filesystem::path& bundle) = 0;
  virtual void send_request(const std::string& node, const std::string& request) = 0;
  /// The text of the PC's report. Empty while there is none, or while the PC does not reply.
  virtual std::string install_report(const std::string& node) = 0;
  /// The present time. Each call may wait for a moment, so that loops do not spin.
  virtual MonotonicInstant wait() = 0;
};

struct UpdateRequest {
  std::filesystem::path bundle;
  std::vector<std::string> nodes;    ///< in this order
  Duration timeout{};                ///< of one node, after the copy
  std::string host = {};             ///< this PC; as an appliance it cannot be updated from here
  bool skips_other_systems = false;  ///< continue behind a PC that is no appliance
};

struct UpdatedNode {
  enum class State { kUpdated, kOtherSystem, kRefused, kFailed, kFellBack, kSilent, kNotTried };
  std::string node;
  State state = State::kNotTried;
  std::string version;  ///< of the bundle; empty where the PC did not report it
  std::string message;  ///< why it is not updated
};
std::string_view name(UpdatedNode::State state);

/// Updates the nodes one after the other, and stops at the first that is not updated, so that a bad
/// bundle stops one PC at most. A PC that is no appliance is skipped where the request says so. A
/// node is updated when its health, sent by a process that has started since, has the version of
/// the bundle and another slot, which is confirmed (slot_trial_flag 0). It fell back when such
/// health has another version or the slot before. Before anything is copied, throws InputError
/// where a node is an appliance and this PC, whose restart would end the command, and
/// std::runtime_error where a take is armed, recorded or closed.
std::vector<UpdatedNode> update_nodes(const UpdateRequest& request, UpdateLink& link);

// Folder of an appliance through which it is updated, reached by rsync. The appliance's program
// install-update describes the files: update_command.cc

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
