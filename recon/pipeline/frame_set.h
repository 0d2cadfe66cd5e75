// Frame sets: the frames of all cameras at one pulse, and their assembly from a stream of frames,
// in which a late camera does not delay the other sets.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "base/config/studio_values.h"
#include "base/core/time.h"
#include "base/geometry/camera_model.h"
#include "base/geometry/rigid_transform.h"
#include "base/image/frame.h"

namespace v3d::recon {

/// The frames of one pulse. `frames` have masks and colours (see observe()); cameras that did not
/// deliver are left out. A camera that is a pulse late may have its frame of the next pulse.
struct FrameSet {
  int64_t pulse = 0;
  std::vector<Frame> frames;
  RealtimeInstant exposure{};  ///< start, by the trigger's node: edge of the pulse; 0: unknown
};

/// The frame of each camera of a rig, in its order, borrowed; null: the camera has no usable frame.
using RigFrames = std::vector<const Frame*>;

/// Frames of unknown cameras, and frames whose mask or image has a wrong size, are ignored.
RigFrames usable_frames(const Rig& rig, const FrameSet& set);

/// Names of the cameras that have a frame, ascending.
std::vector<std::string> names_of(const Rig& rig, const RigFrames& frames);
/// Names of the cameras whose frame is labelled with the pulse after `pulse`, ascending.
std::vector<std::string> late_cameras_of(const RigFrames& frames, int64_t pulse);

struct FrameSetOptions {
  std::vector<std::string> cameras;                    ///< a set is complete with these
  Duration deadline = std::chrono::milliseconds(200);  ///< from the first frame of the set
  int max_open = 16;  ///< incomplete sets at a time; one more releases the oldest
  /// Sets up to this pulse were released before a restart in this take.
  std::optional<int64_t> released_until{};
};

struct ReadySet {
  FrameSet set;                      ///< frames in the order of their cameras' names
  std::vector<std::string> missing;  ///< cameras that did not deliver, ascending
};

struct FrameSetCounters {
  int64_t complete = 0;     ///< sets with every camera
  int64_t incomplete = 0;   ///< sets released without some cameras
  int64_t late = 0;         ///< frames of sets that were already released
  int64_t duplicate = 0;    ///< repeated frames of one camera and pulse; the first is kept
  int64_t unknown = 0;      ///< frames of unknown cameras
  int64_t implausible = 0;  ///< frames whose pulse is not in PlausiblePulses; ignored
  friend bool operator==(const FrameSetCounters&, const FrameSetCounters&) = default;
};

/// Releases sets in the order of their pulses, each once. A pulse without any frame has no set.
/// `now` must never decrease. One thread.
class FrameSetAssembler {
 public:
  explicit FrameSetAssembler(FrameSetOptions options);

  /// Adds a frame. Returns the sets that are ready now.
  std::vector<ReadySet> add(Frame frame, MonotonicInstant now);
  /// Returns the sets whose deadline has passed.
  std::vector<ReadySet> poll(MonotonicInstant now);
  /// Returns all open sets, at the end of a take.
  std::vector<ReadySet> flush();
  /// The next deadline; empty without open sets.
  std::optional<MonotonicInstant> next_deadline() const;
  /// Drops all open sets and accepts pulses from 0 again; the counters keep their values.
  void restart();

  const FrameSetCounters& counters() const { return counters_; }

 private:
  struct OpenSet {
    MonotonicInstant due;
    std::map<std::string, Frame> frames;
  };
  bool is_complete(const OpenSet& set) const { return set.frames.size() == cameras_; }
  void accept(Frame&& frame, MonotonicInstant now);
  void send_oldest(std::vector<ReadySet>& ready);

  FrameSetOptions options_;  ///< cameras sorted, each once
  size_t cameras_;
  std::map<int64_t, OpenSet> open_;
  std::optional<int64_t> last_sent_;
  PlausiblePulses plausible_;
  FrameSetCounters counters_;
};

/// A synthetic frame set for warm-up: a grey ball in the centre of `bounds`, about as large as a
/// person. The first frame set takes several times as long as later ones, because the kernel
/// provides all memory; so this set runs before the first pulse of a take.
FrameSet warm_up_frame_set(const Rig& rig, const Box& bounds);

}  // namespace v3d::recon
