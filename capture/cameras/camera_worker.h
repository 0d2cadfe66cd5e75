// Capture thread of one camera: opens it, labels its frames with pulses, reopens it after a loss.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/core/time.h"
#include "base/image/frame.h"
#include "capture/cameras/camera.h"
#include "capture/sync/pulse_times.h"

namespace v3d::capture {

enum class CameraState : uint8_t {
  kOpening,   ///< not streaming yet; CameraWorkerStatus::text is the reason of the last failure
  kIdle,      ///< streaming; frames are dropped
  kSettling,  ///< armed; waits until no frame has arrived for two periods
  kReady,     ///< armed and quiet: the next exposure is of pulse 0
  kRunning,   ///< labelled frames are delivered
  kLost,      ///< silent for three periods of a train, or not answering and being reopened
};
std::string_view name(CameraState state);

struct CameraWorkerStatus {
  CameraState state = CameraState::kOpening;
  std::string text;       ///< current error in one line; empty if there is none
  CameraStatistics link;  ///< since the worker started, over all times the camera was open
  int64_t frames = 0;     ///< frames labelled since arm()
  int64_t suspect = 0;    ///< frames among these with an uncertain label
  int64_t dropped = 0;    ///< frames among these that were dropped because the queue was full
  int64_t losses = 0;     ///< times the camera was lost since the worker started
  std::string last_loss;  ///< text of the last loss: "no frame for 3 pulses after pulse 9"
  int64_t last_pulse = -1;
  bool is_resuming = false;  ///< no frame since rejoin() is certain; a reported pulse may help
  ImageSize size;            ///< after the camera was first opened
  PixelFormat format = PixelFormat::kMono8;
  CameraDevice device;                         ///< Camera::device() of the last start()
  std::vector<SettingDifference> differences;  ///< Camera::differences() of the last start()
};

struct CameraWorkerOptions {
  size_t queue_frames = 16;                        ///< a full queue drops its oldest frame
  Duration retry_after = std::chrono::seconds(1);  ///< between two attempts to open the camera
  /// A camera that is silent for this time in a train is opened again. This takes longer than the
  /// three periods after which it counts as lost: a stalled host must not close working cameras.
  Duration reopen_after = std::chrono::seconds(1);
  std::function<MonotonicInstant()> now = Monotonic::now;
};

/// Order of calls in a take: arm() -> kReady -> (pulses on) frames -> (pulses off) train_ended() ->
/// pop() until empty -> disarm(). Thread-safe. Functions return immediately, except pop(), which
/// waits, and the destructor, which joins the thread: it waits until the camera answers or times
/// out.
class CameraWorker {
 public:
  using Factory = std::function<std::unique_ptr<Camera>()>;
  /// Opens the camera in the background. CameraWorkerStatus::text reports an InputError of the
  /// factory or of Camera::start().
  CameraWorker(std::string camera, Factory make_camera, CameraWorkerOptions options = {});
  ~CameraWorker();
  /// Requests the thread to close the camera and end. After this call on several workers, their
  /// destructors wait in parallel: a camera that no longer answers takes seconds to close.
  void end();
  CameraWorker(const CameraWorker&) = delete;
  CameraWorker& operator=(const CameraWorker&) = delete;

  const std::string& camera() const;

  /// Starts a take: empties the queue, resets the counters, waits for two periods without a frame.
  /// `edges_are_reported`: pulse_at() will be called; the first frames are held until then.
  void arm(Duration period, bool edges_are_reported = false);
  /// Joins a running take after a restart, instead of arm(). Pulses run already, and `past` holds
  /// this camera's earlier frames. Frames are suspect until their pulse is certain.
  void rejoin(Duration period, bool edges_are_reported, const CameraResumeState& past);
  /// Reports a pulse of the train; the first pulses are sufficient, and after rejoin() those until
  /// a frame is certain. It identifies the pulse of the first frame, and from then on frames are
  /// expected.
  void pulse_at(const PulseEdge& edge);
  /// The generator was stopped: from now on silence is no loss. Frames in flight are still
  /// delivered.
  void train_ended();
  /// Returns to idle and drops the frames in the queue.
  void disarm();

  /// Waits until `deadline` for the next labelled frame. Empty if none arrived. The frame is raw:
  /// its roi is the whole image, and it has no mask.
  std::optional<Frame> pop(MonotonicInstant deadline);

  CameraWorkerStatus status() const;
  /// Number of frames in the queue.
  int64_t waiting() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace v3d::capture
