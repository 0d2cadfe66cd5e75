// Recording pipeline of one camera: write the labelled frame, segment it, publish it.
#pragma once

#include <atomic>
#include <filesystem>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "base/io/result.h"
#include "capture/cameras/camera_worker.h"
#include "capture/segmentation/segmenter.h"
#include "daemon/bus/bus.h"
#include "daemon/captured/live_admission.h"
#include "daemon/captured/preview_sender.h"
#include "daemon/captured/priority_semaphore.h"
#include "daemon/captured/resume_state.h"
#include "daemon/node/heartbeat.h"
#include "take/ledger/exposure_count.h"
#include "take/ledger/ledger.h"
#include "take/logs/frame_log.h"

namespace v3d {

struct CameraPipelineCounts {
  int64_t received = 0;  ///< frames taken from the camera
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
    Segmenter segmenter;
    double rate_hz = 0;                   ///< of the pulses
    std::optional<ResumeState> resume{};  ///< set: the take and its log are continued
    LogHashing hashing = LogHashing::kChecksum;
  };
  /// Shared by all pipelines of a node; outlives them.
  struct Shared {
    Bus& bus;
    PrioritySemaphore& slots;
    LiveAdmission& admission;
  };
  /// Starts the thread. `worker` outlives the pipeline. Throws InputError when the log cannot be
  /// opened.
  CameraPipeline(CameraWorker& worker, Setup setup, Shared shared);
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

  /// Stops the thread and flushes the log. `commanded`: pulses of the take.
  CameraLedger close(int64_t commanded);
  /// After close(): name, size and checksum of the log, for the ledger.
  TakeFile file() const { return log_.file(); }
  /// After close(): whether flushing the log to disk succeeded, else its error.
  const io::Status& synced() const { return synced_; }

 private:
  void run();
  void restore_counts(const ResumeState& state);
  void replay_log();
  void replay_frame(FrameLogReader& log, int64_t pulse);
  void process(Frame frame);
  void write_only(Frame frame);
  FrameMessage make_message(Frame frame);
  /// False when the frame could not be written.
  bool record(const FrameMessage& message);
  /// The mask of a raw frame.
  Mask segment(const Frame& raw, bool learn);
  void publish_live(FrameMessage message, Mask mask);
  void stop_thread();

  CameraWorker& worker_;
  const Shared shared_;
  const std::string take_;
  const std::filesystem::path path_;
  const bool is_resumed_;
  Segmenter segmenter_;
  EventLogWriter log_;
  PreviewSender preview_;
  int64_t log_seq_ = 0;
  FrameNumbers live_numbers_;
  CameraAccount account_;  ///< the pipeline's thread only, until close()
  ExposureCount exposures_;
  io::Status synced_;
  std::atomic<int64_t> received_ = 0;
  std::atomic<int64_t> written_ = 0;
  std::atomic<int64_t> write_errors_ = 0;
  std::atomic<int64_t> published_ = 0;
  std::atomic<int64_t> last_frame_ns_ = 0;
  Heartbeat heartbeat_;
  std::atomic<bool> stopping_ = false;
  std::thread thread_;
};

}  // namespace v3d
