// Rejoining the running take after a restart: which take, and what this node has recorded of it.
#pragma once

#include <atomic>
#include <cstdint>
#include <future>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "base/config/studio_file.h"
#include "capture/cameras/camera.h"
#include "capture/segmentation/segmenter.h"
#include "daemon/bus/event_sender.h"
#include "daemon/captured/take_signers.h"
#include "daemon/node/peer_health.h"
#include "daemon/node/persisted_command.h"
#include "take/ledger/ledger.h"
#include "take/logs/frame_log.h"
#include "take/take.h"
#include "take/take_lock.h"
#include "wire/messages.h"

namespace v3d::captured {

// Resume state of a take: clock, latency and recorded frames of each camera before the daemon
// restarted.

/// Times of pulses by pulse number, by the realtime clock of this node when they were recorded. So
/// the clocks of other nodes do not matter, nor whether this clock was set since. Empty where the
/// time was unknown, or a version of before recorded the pulse.
using EdgeTimes = std::map<int64_t, std::optional<RealtimeInstant>>;

/// The pulses in the take's pulse log. Where the log cannot be read, there are none, and the cause
/// is added to `problems`.
EdgeTimes read_edge_times(const take::TakePaths& take, std::vector<std::string>& problems,
                          const take::ReadProgress& progress = {});

struct ResumeState {
  capture::CameraResumeState camera;
  take::CameraAccount account;  ///< of every frame in the log
  take::ExposureCount exposures;
  /// The log of these frames, so that it is not read again; empty where there is none that can be
  /// read.
  std::optional<take::FrameLogReader> log{};
  std::vector<std::string> problems{};  ///< why frames may be absent: path and cause
};

/// Reads the log of one camera, which takes minutes for a take of hours. A log that does not exist
/// gives a state without frames; so does a log that cannot be read, with the cause. Requires:
/// recover_take() has completed.
ResumeState read_resume_state(const take::TakePaths& take, const std::string& camera,
                              const EdgeTimes& edges, const take::ReadProgress& progress = {});

/// What a node has recorded of a take before its restart.
struct RecordedTake {
  EdgeTimes edges = {};                          ///< of the pulse log
  std::vector<std::string> problems = {};        ///< why pulses may be absent
  std::map<std::string, ResumeState> cameras{};  ///< by name
  /// Of the same cameras, as the plates of the take give them.
  std::map<std::string, segmentation::Segmenter> segmenters{};
};

/// Reads plates and logs of a take in a thread, which may take minutes. The owner is one thread.
class RecordedTakeReader {
 public:
  /// `progress`: called by the thread after each read.
  RecordedTakeReader(take::TakePaths take, std::vector<std::string> cameras,
                     take::ReadProgress progress = {});
  /// Waits for the thread, which ends after its next read.
  ~RecordedTakeReader();
  RecordedTakeReader(const RecordedTakeReader&) = delete;
  RecordedTakeReader& operator=(const RecordedTakeReader&) = delete;

  bool is_done() const;
  /// The file that is being read: "pulses.lcmlog", then the logs of the cameras.
  std::string file() const;
  /// Waits until is_done(). Call once. Throws what prevented the reading: InputError when a camera
  /// has no plates.
  RecordedTake result() { return result_.get(); }

 private:
  RecordedTake read(const take::ReadProgress& progress);

  const take::TakePaths take_;
  const std::vector<std::string> cameras_;
  std::atomic<size_t> opened_logs_ = 0;  ///< of cameras
  std::atomic<bool> stopping_ = false;
  std::future<RecordedTake> result_;
  std::thread thread_;
};

/// A take that is resumed.
struct TakeToResume {
  wire::CommandMessage order;
  int64_t commanded = 0;  ///< pulses of the take until now, or a little fewer
  take::TakeLock lock;
  RecordedTake recorded;
};

/// Finds the take that the node rejoins, locks it and reads its logs. No call waits for the logs,
/// so the node executes orders meanwhile. Sends events while the node does not record. One thread.
class TakeRejoin {
 public:
  /// Everything referred to outlives this object. `progress`: see RecordedTakeReader.
  TakeRejoin(const Studio& studio, const std::string& node, node::PersistedCommands& commands,
             RecoveredTakeSigner& signer, bus::EventSender& events,
             take::ReadProgress progress = {})
      : studio_(studio),
        node_(node),
        commands_(commands),
        signer_(signer),
        events_(events),
        progress_(std::move(progress)) {}

  /// Call while the node may rejoin. Returns the running take once its logs have been read. Throws
  /// InputError when it cannot be locked, or not be read.
  ///
  /// Until cancel(), no recovered take is signed, because signing needs the lock.
  std::optional<TakeToResume> poll(node::TrainMonitor& train);
  /// Call before each poll() that may follow: cancels, and ends text(), when the last call was
  /// followed by none.
  void cancel_unless_polled();
  /// Ends the reading and releases the lock, if it was not returned.
  void cancel();
  /// Call when the take is recorded again, from pulse `commanded` on: sends an event.
  void finish(int64_t commanded);
  /// Call after poll() has thrown, or the take could not be resumed: cancels, and sends an alarm
  /// with the cause.
  void fail(const std::string& cause);
  /// Why the node does not record the running take, for its health; else empty.
  std::string text() const;

 private:
  struct Reading {
    std::unique_lock<std::mutex> no_signing;
    int64_t commanded = 0;
    std::optional<take::TakeLock> lock;
    std::optional<RecordedTakeReader> reader;
  };

  void begin(const node::PersistedCommands::Found& found);
  void follow(node::TrainMonitor& train);
  void forget_ended_take(node::TrainMonitor& train);

  const Studio& studio_;
  const std::string& node_;
  node::PersistedCommands& commands_;
  RecoveredTakeSigner& signer_;
  bus::EventSender& events_;
  const take::ReadProgress progress_;
  wire::CommandMessage order_;  ///< of the take that is or was read
  std::unique_ptr<Reading> reading_;
  std::string failure_;      ///< of the take that runs; else empty
  bool was_polled_ = false;  ///< since cancel_unless_polled()
};

}  // namespace v3d::captured
