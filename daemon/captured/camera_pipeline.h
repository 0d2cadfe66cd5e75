// The way of one camera's frames through a take: label -> disk -> mask -> network.
#pragma once

#include <atomic>
#include <filesystem>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

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
  int64_t write_errors = 0;  ///< frames that the disk refused
  int64_t published = 0;
};

/// Lives from the moment a take is armed until it is closed. Has a thread of its own, so that the
/// frames of a camera keep their order and a segmenter its memory. A frame's pixels go to the
/// kernel from where they are, and once more for what is in front: into the message. A lane that
/// waits for the disk holds no place.
class CameraPipeline {
 public:
  struct Setup {
    std::string take;
    std::filesystem::path log;
    Segmenter segmenter;
    double rate_hz = 0;
    std::optional<ResumeState> past{};  ///< of a take that goes on: so does the log
    LogHashing hashing = LogHashing::kChecksum;
  };
  /// What the lanes of a node share; all outlive the lane.
  struct Shared {
    Bus& bus;
    PrioritySemaphore& places;
    LiveAdmission& gate;
  };
  /// `worker` outlives the lane. Throws InputError when the log cannot be made.
  CameraPipeline(CameraWorker& worker, Setup setup, Shared shared);
  /// Stops without waiting for more frames.
  ~CameraPipeline();
  CameraPipeline(const CameraPipeline&) = delete;
  CameraPipeline& operator=(const CameraPipeline&) = delete;

  const std::string& camera() const { return worker_.camera(); }
  CameraPipelineCounts counts() const;
  /// No frame waits, and none is being worked on; the last came before `since`.
  bool quiet_since(MonotonicInstant since) const;
  bool progressed_since(MonotonicInstant since) const { return heartbeat_.since(since); }

  /// Ends the thread, closes the log and gives the account.
  CameraLedger close(int64_t commanded);
  /// After close(): what the lane has written, for the ledger.
  TakeFile file() const { return log_.file(); }
  /// After close(): the disk has kept what it took.
  bool is_kept() const { return kept_; }

 private:
  void run();
  void go_on_from(const ResumeState& past);
  void learn_again();
  void learn_from(FrameLogReader& log, int64_t pulse);
  void process(Frame frame);
  void write_only(Frame frame);
  FrameMessage message_of(Frame frame);
  /// Whether the frame is in the log.
  bool record(const FrameMessage& message);
  /// The raw frame's mask.
  Mask segment(const Frame& raw, bool learn);
  void go_live(FrameMessage message, Mask mask);
  void end();

  CameraWorker& worker_;
  const Shared shared_;
  const std::string take_;
  const std::filesystem::path path_;
  const bool goes_on_;
  Segmenter segmenter_;
  EventLogWriter log_;
  PreviewSender preview_;
  int64_t log_seq_ = 0;
  FrameNumbers live_numbers_;
  CameraAccount account_;  // of the lane's thread until close()
  ExposureCount exposures_;
  bool kept_ = true;
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
