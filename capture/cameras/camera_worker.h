// One camera of a node, kept going by a thread of its own: opened, armed, its frames labelled with
// pulses, reopened when it is lost.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "base/core/time.h"
#include "base/image/frame.h"
#include "capture/cameras/camera.h"
#include "capture/cameras/camera_resume_state.h"
#include "capture/sync/train_start.h"

namespace v3d {

enum class CameraState : uint8_t {
  kOpening,   ///< not streaming yet; `text` says what it last failed for
  kIdle,      ///< streaming; frames are thrown away
  kSettling,  ///< armed; waiting until no frame came for two periods
  kReady,     ///< armed and quiet: the next exposure is pulse 0
  kRunning,   ///< labelled frames are delivered
  kLost,      ///< in a train, but silent for three periods; or not answering, being opened again
};
std::string_view name(CameraState state);

struct CameraWorkerStatus {
  CameraState state = CameraState::kOpening;
  std::string text;       ///< one line: what is wrong, else empty
  CameraStatistics link;  ///< since the worker began, over all times it was opened
  int64_t frames = 0;     ///< labelled since arm()
  int64_t suspect = 0;    ///< of these, with a label in doubt
  int64_t dropped = 0;    ///< of these, thrown away because the queue was full
  int64_t losses = 0;     ///< times the camera was lost since the worker began
  std::string last_loss;  ///< what was noticed the last time: "no frame for 3 pulses after pulse 9"
  int64_t last_pulse = -1;
  ImageSize size;  ///< after the camera was first opened
  PixelFormat format = PixelFormat::kMono8;
};

struct CameraWorkerOptions {
  size_t queue_frames = 16;                        ///< the oldest is dropped when it is full
  Duration retry_after = std::chrono::seconds(1);  ///< between two tries to open
  /// A camera that is silent for so long in a train is opened again. Longer than the three periods
  /// after which it counts as lost: a host that stalls must not throw healthy cameras away.
  Duration reopen_after = std::chrono::seconds(1);
  std::function<MonotonicInstant()> now = Monotonic::now;
};

/// The order of a take: arm() -> kReady -> (pulses on) frames -> (pulses off) train_ended() ->
/// take() until empty -> disarm(). All functions may be called from any thread and return at once,
/// except that take() waits and the destructor joins (it takes as long as the camera takes to
/// answer or to time out).
class CameraWorker {
 public:
  using Factory = std::function<std::unique_ptr<Camera>()>;
  /// Opens in the background. An InputError of the factory or of Camera::start() becomes `text`.
  CameraWorker(std::string camera, Factory make_camera, CameraWorkerOptions options = {});
  ~CameraWorker();
  /// Lets the thread close the camera and end, so that the destructors of several workers need not
  /// wait in turn: a camera that no longer answers takes seconds.
  void end();
  CameraWorker(const CameraWorker&) = delete;
  CameraWorker& operator=(const CameraWorker&) = delete;

  const std::string& camera() const;

  /// Forgets the take before: empties the queue, counts from zero, waits for two quiet periods.
  /// `edges_are_told`: pulse_at() will be called; the first frames wait a little for it.
  void arm(Duration period, bool edges_are_told = false);
  /// Instead of arm() and the quiet: pulses run already, and this camera's frames of before are
  /// known. Frames that come while nobody can tell their pulse for certain are suspect.
  void rejoin(Duration period, bool edges_are_told, const CameraResumeState& past);
  /// A pulse of the train; the first ones are enough. Says which pulse the first frame is of, and
  /// that a frame is due.
  void pulse_at(const PulseEdge& edge);
  /// The generator was stopped: from here on silence is no loss. Frames on their way still come.
  void train_ended();
  /// Back to idle; frames that nobody took are thrown away.
  void disarm();

  /// The next labelled frame (raw: roi is the whole image, no mask), waiting until `deadline`;
  /// empty when none came.
  std::optional<Frame> take(MonotonicInstant deadline);

  CameraWorkerStatus status() const;
  /// Frames that wait for take().
  int64_t waiting() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace v3d
