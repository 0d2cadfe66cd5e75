// Frame sets: all cameras, one pulse. A late camera does not stop the others.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "base/camera_model.h"
#include "base/frame.h"
#include "base/geometry.h"
#include "base/time.h"
#include "recon/pipeline/reconstructor.h"

namespace v3d {

struct FrameSetOptions {
  std::vector<std::string> cameras;                    ///< every set waits for these
  Duration deadline = std::chrono::milliseconds(200);  ///< counted from the first frame of the set
  int max_open = 16;  ///< sets that wait at a time; one more sends the oldest on its way
  /// A frame so far ahead of all before it is a broken label, and is not believed: it would make
  /// every later frame a late one.
  int64_t max_jump = 15'000;
  /// Sets up to this pulse had gone before, in a take that goes on.
  std::optional<int64_t> gone_until{};
};

struct ReadySet {
  FrameSet set;                      ///< frames in the order of their cameras' names
  std::vector<std::string> missing;  ///< cameras that did not deliver, ascending
};

struct FrameSetCounters {
  int64_t complete = 0;     ///< sets with every camera
  int64_t incomplete = 0;   ///< sets sent on without some
  int64_t late = 0;         ///< frames whose set had gone
  int64_t duplicate = 0;    ///< second frames of one camera and pulse; the first is kept
  int64_t unknown = 0;      ///< frames of cameras that are not expected
  int64_t implausible = 0;  ///< frames with a negative pulse, or beyond max_jump
  friend bool operator==(const FrameSetCounters&, const FrameSetCounters&) = default;
};

/// Sets come out in the order of their pulses, each once. A pulse of which no frame arrived has no
/// set. Time is an argument, and `now` never goes back. One thread.
class FrameSetAssembler {
 public:
  explicit FrameSetAssembler(FrameSetOptions options);

  /// The sets that this frame, or the time, made ready.
  std::vector<ReadySet> add(Frame frame, MonotonicInstant now);
  /// The sets that the time made ready.
  std::vector<ReadySet> poll(MonotonicInstant now);
  /// All open sets, as they are: the take has ended.
  std::vector<ReadySet> flush();
  /// When poll() has something to do next; empty when no set is open.
  std::optional<MonotonicInstant> next_deadline() const;
  /// Forgets open sets and starts to count pulses anew; the counters stay.
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
  std::optional<int64_t> newest_;
  FrameSetCounters counters_;
};

/// A grey ball in the middle of `bounds`, about as large as a person, as the cameras see it. The
/// first frame set costs several times what later ones do, because all memory is fetched from the
/// kernel for it; in a take it would be late, and those behind it, too.
FrameSet warm_up_frame_set(const Rig& rig, const Box& bounds);

}  // namespace v3d
