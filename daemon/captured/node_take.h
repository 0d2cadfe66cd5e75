// Recording of a take and of each camera.
#pragma once

#include <atomic>
#include <filesystem>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "base/config/studio_file.h"
#include "base/io/file.h"
#include "capture/cameras/camera_worker.h"
#include "capture/segmentation/segmenter.h"
#include "daemon/bus/bus.h"
#include "daemon/captured/live_admission.h"
#include "daemon/captured/node_devices.h"
#include "daemon/captured/node_sound.h"
#include "daemon/captured/preview.h"
#include "daemon/captured/take_disk.h"
#include "daemon/captured/take_rejoin.h"
#include "daemon/node/service.h"
#include "take/ledger/ledger.h"
#include "take/ledger/take_signature.h"
#include "take/logs/frame_log.h"
#include "take/take.h"
#include "take/take_lock.h"
#include "wire/messages.h"

namespace v3d::captured {

// Recording pipeline of one camera: write the labelled frame, segment it, publish it.

struct CameraPipelineCounts {
  int64_t received = 0;  ///< frames taken from the camera
  int64_t pulses = 0;    ///< with a written frame that is not suspect; of this process
  int64_t written = 0;
  int64_t write_errors = 0;  ///< frames that could not be written
  int64_t published = 0;
};

/// Lives from arming until the take is closed.
///
/// Each camera has one thread, so that its frames stay in order and its segmenter keeps its state.
/// Pixels are written to the log without a copy. For the network, pixels near the foreground are
/// copied once, into the message. The pipeline holds no semaphore slot while it writes to disk.
class CameraPipeline {
 public:
  struct Setup {
    std::string take;
    std::filesystem::path log;
    segmentation::Segmenter segmenter;
    double rate_hz = 0;                   ///< of the pulses
    std::optional<ResumeState> resume{};  ///< set: the take and its log are continued
    take::LogHashing hashing = take::LogHashing::kChecksum;
  };
  /// Shared by all pipelines of a node; outlives them.
  struct Shared {
    bus::Bus& bus;
    PrioritySemaphore& slots;
    LiveAdmission& admission;
  };
  /// Starts the thread. `worker` outlives the pipeline. Throws InputError when the log cannot be
  /// opened.
  CameraPipeline(capture::CameraWorker& worker, Setup setup, Shared shared);
  /// Stops without waiting for more frames.
  ~CameraPipeline();
  CameraPipeline(const CameraPipeline&) = delete;
  CameraPipeline& operator=(const CameraPipeline&) = delete;

  const std::string& camera() const { return worker_.camera(); }
  /// Any thread.
  CameraPipelineCounts counts() const;
  /// True when no frame is queued or being processed, and the last one came before `since`.
  bool idle_since(MonotonicInstant since) const;
  bool progressed_since(MonotonicInstant since) const { return heartbeat_.beat_since(since); }

  /// Stops the thread, flushes the log and ends it. `commanded`: pulses of the take.
  take::CameraLedger close(int64_t commanded);
  /// After close(): see take::EventLogWriter::save_index(). An error is written to the daemon's
  /// log.
  void save_index() const;
  /// After close(): name, size and checksum of the log, for the ledger.
  take::TakeFile file() const { return log_.file(); }
  /// After close(): whether flushing the log to disk succeeded, else its error.
  const io::Status& synced() const { return synced_; }

 private:
  void run();
  void restore_counts(const ResumeState& state);
  void replay_logs();
  void replay(take::FrameLogReader& log);
  void learn_again(take::FrameLogReader& log, int64_t pulse);
  void write_waiting_frames();
  void process(Frame frame);
  void write_only(Frame frame);
  void count_finished_frame();
  wire::FrameMessage make_message(Frame frame);
  /// False when the frame could not be written.
  bool record(const wire::FrameMessage& message);
  /// The mask of a raw frame.
  Mask segment(const Frame& raw, bool learn);
  void publish_live(wire::FrameMessage message, Mask mask);
  void stop_thread();

  capture::CameraWorker& worker_;
  const Shared shared_;
  const std::string take_;
  std::optional<take::FrameLogReader> earlier_log_;  ///< of before a restart; empty when replayed
  const bool is_resumed_;
  segmentation::Segmenter segmenter_;
  take::EventLogWriter log_;
  PreviewSender preview_;
  int64_t log_seq_ = 0;
  bus::FrameNumbers live_numbers_;
  take::CameraAccount account_;  ///< this and the next: the pipeline's thread only, until close()
  take::PulseSet certain_pulses_;
  take::ExposureCount exposures_;
  io::Status synced_;
  std::atomic<int64_t> received_ = 0;
  std::atomic<int64_t> pulses_ = 0;
  std::atomic<int64_t> written_ = 0;
  std::atomic<int64_t> write_errors_ = 0;
  std::atomic<int64_t> published_ = 0;
  std::atomic<int64_t> last_frame_ns_ = 0;
  node::Heartbeat heartbeat_;
  std::atomic<bool> stopping_ = false;
  std::thread thread_;
};

// Recording of one take on a capture node: a CameraPipeline for every camera, the admission of live
// pulses, and the disk.

/// Result of closing a take: one line each for the operator, empty where there is nothing to
/// report.
struct TakeCloseReport {
  /// The ledger could not be written, or the take stays open (state recording) until a recovery
  /// counts it: its last frames or pulses could not be written, or its earlier ones not be read.
  std::string error = {};
  std::string pulse_log_error = {};    ///< pulses are missing from pulses.lcmlog
  std::string quarantine_notice = {};  ///< the take is empty and was moved to the quarantine
  std::string signing_error = {};      ///< empty where takes are not signed, too
  /// A file could not be read, so the ledger has no checksum of it.
  std::string checksum_error = {};
};

/// Lives from arming until the ledger is written. Holds the take's lock. One thread.
class NodeTake {
 public:
  /// Everything referred to outlives the take.
  struct Context {
    const Studio& studio;
    const std::string& name;  ///< of the node
    bus::Bus& bus;
    NodeCameras& cameras;
    PrioritySemaphore& slots;
    std::shared_ptr<const take::TakeSigner> signer = nullptr;  ///< null: the take is not signed
    NodeSound* sound = nullptr;  ///< null: the node has no sound input
  };
  struct Plan {
    wire::CommandMessage order;
    DiskDemand disk;  ///< its rate is that of the take
  };

  /// Creates the folder of a new take, and a pipeline for every camera that is ready. Throws
  /// InputError, also when the take exists or another process records into it under the node's
  /// name. After another failure, the folder is in the quarantine and the name is free again.
  static std::unique_ptr<NodeTake> begin(const Context& context, const Plan& plan);

  /// Resumes a take after a restart; rejoin() must follow. A take whose recovery has failed stays
  /// open when it is closed. Throws InputError.
  static std::unique_ptr<NodeTake> resume(const Context& context, const Plan& plan,
                                          TakeToResume resumed);
  /// After resume(): lets cameras and sound join. Call it when pulses are reported: a camera
  /// delivers its first frames when a pulse was reported, and cannot hold them for long.
  /// `edges_are_reported`: see NodeTrigger::reports_edges(). Afterwards the caller must disarm the
  /// cameras.
  void rejoin(bool edges_are_reported);

  /// Ends the recording of sound. Where rejoin() did not follow on resume() and nothing was added
  /// to the take, the take is as it was before.
  ~NodeTake();
  NodeTake(const NodeTake&) = delete;
  NodeTake& operator=(const NodeTake&) = delete;

  const take::TakePaths& paths() const { return paths_; }
  size_t camera_count() const { return pipelines_.size(); }
  bool records(const std::string& camera) const;

  /// Sum over all pipelines.
  CameraPipelineCounts counts() const;
  int64_t pulses_not_live() const { return admission_.skipped(); }
  /// True when every camera has delivered certain frames of `pulses` pulses or, where a time is
  /// given, has been idle since then. More frames than pulses do not count: one may be surplus.
  bool has_received(int64_t pulses, std::optional<MonotonicInstant> idle_since) const;
  bool progressed_since(MonotonicInstant since) const;

  /// See TakeDisk.
  std::string disk_stop_reason() { return disk().stop_reason(disk_errors()); }
  std::string disk_warning() { return disk().warning(disk_errors()); }
  std::string queue_warning() { return disk_->queue_warning(context_.cameras.max_queued()); }

  /// Stops the pipelines and adds cameras and files to `ledger`, whose `commanded` is set.
  void stop_pipelines(take::Ledger& ledger);
  /// After stop_pipelines(): writes and signs the ledger. Moves the take to the quarantine
  /// (take/take_removal.h) if `is_empty` and no frame log has a byte. `pulse_log`: whether it was
  /// flushed to disk. Only the destructor may be called afterwards.
  TakeCloseReport close(const take::Ledger& ledger, bool is_empty, const io::Status& pulse_log);

 private:
  NodeTake(Context context, take::TakeInfo info, const DiskDemand& demand, take::TakeLock lock);
  static std::unique_ptr<NodeTake> create(const Context& context, const Plan& plan,
                                          take::TakeLock lock);
  /// Marks the take as recording, and adds the pipelines of its cameras.
  void reopen(RecordedTake recorded);
  void add_resumed_pipelines(RecordedTake recorded);
  void undo_reopen();
  void begin_sound();
  /// The sound files of this node from before a restart, as the recovery has mapped them.
  std::vector<take::SoundLedger> earlier_sounds() const;
  /// The sound files of this node.
  std::vector<take::SoundLedger> end_sound();
  void add_pipeline(capture::CameraWorker& worker, segmentation::Segmenter segmenter,
                    std::optional<ResumeState> resume = {});
  DiskErrors disk_errors() const;
  /// The disk, with the demand of all cameras that were opened until now.
  TakeDisk& disk();
  /// What could not be flushed to disk, with the first cause; empty if everything was.
  std::string unsynced(const io::Status& pulse_log) const;
  /// Why a recovery must count the take again; empty if it is closed.
  std::string open_reason(const io::Status& pulse_log) const;
  /// `unread`: files without a checksum, one line each. Logs them; returns the first with the take.
  std::string checksum_error(const std::vector<std::string>& unread) const;
  /// Signs the take. Returns the error; empty on success and without a signing key.
  std::string sign(const std::vector<take::TakeFile>& files) const;
  /// Makes the names of the logs survive a power cut. Throws InputError.
  void sync_names() const;

  const Context context_;
  take::TakeInfo info_;
  const take::TakePaths paths_;
  std::optional<take::TakeLock> lock_;  ///< empty when closed
  std::unique_ptr<TakeDisk> disk_;      ///< null when closed
  LiveAdmission admission_;
  std::vector<std::unique_ptr<CameraPipeline>> pipelines_;
  std::vector<take::SoundLedger> earlier_sounds_;  ///< of before a restart of the daemon
  std::vector<std::string> unread_;  ///< why frames or pulses before a restart are not counted

  /// Of a take between resume() and rejoin().
  struct Resuming {
    take::TakeInfo info;                      ///< as before
    std::vector<std::filesystem::path> logs;  ///< that existed before
    std::map<capture::CameraWorker*, capture::CameraResumeState> cameras{};
    bool has_signature_aside = false;  ///< see take::set_signature_aside()
  };
  std::optional<Resuming> resuming_;
};

}  // namespace v3d::captured
