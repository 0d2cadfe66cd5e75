// Surfaces of a take, pulse by pulse, with temporal smoothing.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <vector>

#include "daemon/recorded/take_frames.h"
#include "recon/pipeline/reconstructor.h"
#include "v3dctl/reconstruct/take_silhouette_repair.h"

namespace v3d::ctl {

/// Surface of one pulse; its vertices have no colours yet.
struct TakeSurface {
  SegmentedFrames frames;     ///< empty for a copy_of_input()
  bool lacks_camera = false;  ///< a camera of the rig had no usable frame, before the repair
  double segment_ms = -1;     ///< negative: the pulse was not read for this surface
  recon::FrameSetJob work;
};

/// A surface that has only the input of `work`: its frame set and number of passes.
TakeSurface copy_of_input(const recon::FrameSetJob& work);

/// Reads and segments the pulses of a take, with silhouette repair. One caller at a time.
class TakeInput {
 public:
  /// All references are borrowed. `passes`: FrameSetJob::live_passes by pulse. `repair` and
  /// `live_repair`: null for none.
  TakeInput(recorded::TakeFrames& take, const std::map<int64_t, int>& passes,
            TakeSilhouetteRepair* repair, LivePulseRepair* live_repair);

  /// The input of a pulse, without a surface. Fast for increasing pulses. Throws as
  /// TakeFrames::read().
  TakeSurface read(int64_t pulse);

 private:
  void set_previous_of(int64_t pulse);
  void repair(int64_t pulse, SegmentedFrames& frames);

  recorded::TakeFrames& take_;
  const std::map<int64_t, int>& passes_;
  TakeSilhouetteRepair* repair_;
  LivePulseRepair* live_repair_;
  const std::vector<int64_t> pulses_;  ///< of the take, increasing
  int64_t next_pulse_ = -1;
  SegmentedFrames next_;  ///< frames of next_pulse_, already read for the repair
};

/// A smoothed surface depends on the surfaces one pulse before and after, and these on the views
/// one pulse farther: a window of two pulses to each side, of three with silhouette repair. It
/// depends on nothing else, so order and shards do not change it. One caller at a time, in its TBB
/// arena.
class TakeSurfaces {
 public:
  using ReadInput = std::function<TakeSurface(int64_t pulse)>;

  /// `pulses`: all of the take, increasing. `read`: the input of one of them, called once for each
  /// pulse of the window. `reconstructor` is borrowed. Without `smooth`, each pulse is
  /// reconstructed alone.
  TakeSurfaces(recon::Reconstructor& reconstructor, std::vector<int64_t> pulses, ReadInput read,
               bool smooth);

  /// Requires increasing pulses that the take has. Throws as `read`.
  TakeSurface make(int64_t pulse);

  /// The input of a pulse in the window of the last make(), except of the pulse that it made.
  /// Null without smoothing, and for other pulses.
  const recon::FrameSetJob* input_in_window(int64_t pulse) const;

 private:
  struct WindowEntry {
    TakeSurface surface;  ///< a hull until `deformed`; moved away by make()
    recon::PulseViews views;
    bool deformed = false;
  };
  bool has(int64_t pulse) const;
  void make_hull(int64_t pulse);
  void deform(int64_t pulse);
  std::vector<const recon::PulseViews*> neighbours(int64_t pulse) const;

  recon::Reconstructor& reconstructor_;
  const std::vector<int64_t> pulses_;
  const ReadInput read_;
  const bool smooth_;
  std::map<int64_t, WindowEntry> window_;
};

}  // namespace v3d::ctl
