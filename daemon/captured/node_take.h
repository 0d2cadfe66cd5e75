// Recording of one take on a capture node: a CameraPipeline for every camera, the admission of live
// pulses, and the disk.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/config/studio_file.h"
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

/// Result of closing a take: one line each for the operator, empty where there is nothing to
/// report.
struct TakeCloseReport {
  std::string write_error = {};        ///< ledger or last frames could not be written to disk
  std::string pulse_log_error = {};    ///< pulses are missing from pulses.lcmlog
  std::string quarantine_notice = {};  ///< the take is empty and was moved to the quarantine
  std::string signing_error = {};      ///< empty without a signing key, too
};

/// Lives from arming until the ledger is written. Holds the take's lock. One thread.
class NodeTake {
 public:
  /// Everything referred to outlives the take.
  struct Context {
    const Studio& studio;
    const std::string& name;  ///< of the node
    Bus& bus;
    NodeCameras& cameras;
    PrioritySemaphore& slots;
    const TakeSigner* signer = nullptr;  ///< null: takes are not signed
  };
  struct Plan {
    CommandMessage order;
    DiskDemand disk;  ///< its rate is that of the take
  };

  /// Creates the folder of a new take, and a pipeline for every camera that is ready. Throws
  /// InputError; also while another process records into this take under the node's name.
  static std::unique_ptr<NodeTake> begin(Context context, const Plan& plan);

  /// Resumes a take after a restart. `pulses`: the pulses in the log, by which cameras find their
  /// pulse numbers. `edges_are_reported`: see NodeTrigger::reports_edges(). Throws InputError; the
  /// caller must then disarm the cameras.
  static std::unique_ptr<NodeTake> resume(Context context, const Plan& plan,
                                          const EdgeTimes& pulses, bool edges_are_reported);

  const TakePaths& paths() const { return paths_; }

  /// Sum over all pipelines.
  CameraPipelineCounts counts() const;
  int64_t pulses_not_live() const { return admission_.skipped(); }
  /// True when every camera has delivered `pulses` frames or, where a time is given, has been idle
  /// since then.
  bool has_received(int64_t pulses, std::optional<MonotonicInstant> idle_since) const;
  bool progressed_since(MonotonicInstant since) const;

  /// See TakeDisk.
  std::string disk_stop_reason() const { return disk_->stop_reason(disk_errors()); }
  std::string disk_warning() const { return disk_->warning(disk_errors()); }
  std::string queue_warning() { return disk_->queue_warning(context_.cameras.max_queued()); }

  /// Stops the pipelines and adds cameras and files to `ledger`, whose `commanded` is set.
  void stop_pipelines(Ledger& ledger);
  /// After stop_pipelines(): writes and signs the ledger. Moves the take to the quarantine
  /// (take/take_removal.h) if `is_empty` and no frame log has a byte. Only the destructor may be
  /// called afterwards.
  TakeCloseReport close(const Ledger& ledger, bool is_empty);

 private:
  NodeTake(Context context, TakeInfo info, const DiskDemand& demand, TakeLock lock);
  void add_pipeline(CameraWorker& worker, const BackgroundModel& background,
                    std::optional<ResumeState> resume = {});
  DiskErrors disk_errors() const;
  /// Cameras whose log could not be flushed to disk, separated by commas.
  std::string unsynced_cameras() const;
  /// Signs the take. Returns the error; empty on success and without a signing key.
  std::string sign(const std::vector<TakeFile>& files) const;
  /// Makes the names of the logs survive a power cut. Throws InputError.
  void sync_names() const;

  const Context context_;
  TakeInfo info_;
  const TakePaths paths_;
  std::optional<TakeLock> lock_;    ///< empty when closed
  std::unique_ptr<TakeDisk> disk_;  ///< null when closed
  LiveAdmission admission_;
  std::vector<std::unique_ptr<CameraPipeline>> pipelines_;
};

}  // namespace v3d
