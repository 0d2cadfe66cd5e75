// What a capture node records of one take: a lane for every camera, which of the pulses go live,
// and the disk.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/studio_file.h"
#include "daemon/bus/bus.h"
#include "daemon/captured/camera_pipeline.h"
#include "daemon/captured/live_admission.h"
#include "daemon/captured/node_cameras.h"
#include "daemon/captured/priority_semaphore.h"
#include "daemon/captured/resume_state.h"
#include "daemon/captured/take_disk.h"
#include "take/ledger/ledger.h"
#include "take/ledger/take_signature.h"
#include "take/take.h"
#include "take/take_lock.h"
#include "wire/messages.h"

namespace v3d {

/// How the closing of a take went, for a person.
struct TakeClosing {
  std::string unkept = {};        ///< data that the disk accepted and lost; empty when it kept all
  std::string lost_pulses = {};   ///< that the log of the pulses is not whole; mostly empty
  std::string notice = {};        ///< that the take was moved to the quarantine; mostly empty
  std::string unsigned_why = {};  ///< error of signing; empty on success and without a signing key
};

/// From the moment a take is armed until its ledger is written. One thread.
class NodeTake {
 public:
  /// All outlive the take.
  struct Node {
    const Studio& studio;
    const std::string& name;
    Bus& bus;
    NodeCameras& cameras;
    PrioritySemaphore& places;
    const TakeSigner* signer = nullptr;  ///< null: takes are not signed
  };
  struct Plan {
    CommandMessage order;
    DiskDemand disk;  ///< its rate is the take's
  };

  /// Makes the folder of a new take and a lane for every camera that is ready. Throws InputError,
  /// also while another process records into it as this node.
  static std::unique_ptr<NodeTake> begin(Node node, const Plan& plan);

  /// A take that this node was in before it was started anew: its cameras go on where `pulses` say.
  /// Throws InputError; what it did to the cameras until then, disarming them undoes.
  static std::unique_ptr<NodeTake> go_on(Node node, const Plan& plan, const EdgeTimes& pulses,
                                         bool edges_are_told);

  const TakePaths& paths() const { return paths_; }

  /// Of all lanes together.
  CameraPipelineCounts counts() const;
  int64_t pulses_not_live() const { return gate_.skipped(); }
  /// Every camera has delivered so many frames or, where a time is given, been quiet since.
  bool has_all(int64_t pulses, std::optional<MonotonicInstant> quiet_since) const;
  bool progressed_since(MonotonicInstant since) const;

  /// As TakeDisk says.
  std::string disk_must_end() const { return disk_->must_end(progress()); }
  std::string disk_trouble() const { return disk_->trouble(progress()); }
  std::string queue_trouble() { return disk_->queue_trouble(node_.cameras.most_waiting()); }

  /// Ends the lanes; gives the account of every camera.
  void end(Ledger& ledger);
  /// After end(): writes the ledger, and moves the take to the quarantine (take/take_removal.h)
  /// where `is_empty` and no log of a camera has a byte. Nothing else may be asked afterwards.
  TakeClosing close(const Ledger& ledger, bool is_empty);

 private:
  NodeTake(Node node, TakeInfo info, const DiskDemand& demand, TakeLock lock);
  void add_lane(CameraWorker& worker, const BackgroundModel& background,
                std::optional<ResumeState> past = {});
  DiskProgress progress() const;
  /// Signs the take. Returns the error; empty on success, and where the node has no signing key.
  std::string sign(const std::vector<TakeFile>& files) const;
  /// The names of the logs survive a power cut from now on. Throws InputError.
  void sync_names() const;

  const Node node_;
  TakeInfo info_;
  const TakePaths paths_;
  std::optional<TakeLock> lock_;    ///< empty when closed
  std::unique_ptr<TakeDisk> disk_;  ///< null when closed
  LiveAdmission gate_;
  std::vector<std::unique_ptr<CameraPipeline>> lanes_;
};

}  // namespace v3d
