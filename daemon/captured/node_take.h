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
  /// The ledger could not be written, or the take stays open (state recording) until a recovery
  /// counts it: its last frames or pulses could not be written, or its earlier ones not be read.
  std::string error = {};
  std::string pulse_log_error = {};    ///< pulses are missing from pulses.lcmlog
  std::string quarantine_notice = {};  ///< the take is empty and was moved to the quarantine
  std::string signing_error = {};      ///< empty where takes are not signed, too
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
    std::shared_ptr<const TakeSigner> signer = nullptr;  ///< null: the take is not signed
  };
  struct Plan {
    CommandMessage order;
    DiskDemand disk;  ///< its rate is that of the take
  };

  /// Creates the folder of a new take, and a pipeline for every camera that is ready. Throws
  /// InputError, also when the take exists or another process records into it under the node's
  /// name. After another failure, the folder is in the quarantine and the name is free again.
  static std::unique_ptr<NodeTake> begin(const Context& context, const Plan& plan);

  /// The pulses in the log of a take, by which cameras find their pulse numbers.
  struct LoggedPulses {
    EdgeTimes edges = {};
    std::vector<std::string> problems = {};  ///< why pulses may be absent
  };
  /// Resumes a take after a restart. `edges_are_reported`: see NodeTrigger::reports_edges(). Throws
  /// InputError; the caller must then disarm the cameras.
  static std::unique_ptr<NodeTake> resume(const Context& context, const Plan& plan,
                                          const LoggedPulses& pulses, bool edges_are_reported);

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
  /// (take/take_removal.h) if `is_empty` and no frame log has a byte. `pulse_log`: whether it was
  /// flushed to disk. Only the destructor may be called afterwards.
  TakeCloseReport close(const Ledger& ledger, bool is_empty, const io::Status& pulse_log);

 private:
  NodeTake(Context context, TakeInfo info, const DiskDemand& demand, TakeLock lock);
  static std::unique_ptr<NodeTake> create(const Context& context, const Plan& plan, TakeInfo info,
                                          TakeLock lock);
  void add_pipeline(CameraWorker& worker, const BackgroundModel& background,
                    std::optional<ResumeState> resume = {});
  DiskErrors disk_errors() const;
  /// What could not be flushed to disk, with the first cause; empty if everything was.
  std::string unsynced(const io::Status& pulse_log) const;
  /// Why a recovery must count the take again; empty if it is closed.
  std::string open_reason(const io::Status& pulse_log) const;
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
  std::vector<std::string> unread_;  ///< why frames or pulses before a restart are not counted
};

}  // namespace v3d
