// Surfaces of a take, pulse by pulse, with silhouette repair and temporal smoothing.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "daemon/recorded/take_frames.h"
#include "recon/pipeline/frame_set_repair.h"
#include "recon/pipeline/reconstructor.h"
#include "recon/silhouettes/silhouette_repair.h"

namespace v3d::ctl {

// Silhouette repair of a take: masks are corrected by those of the other cameras.

struct PulseFault {
  int64_t pulse = 0;
  std::string camera;
  recon::SilhouetteFault fault;
};

/// Frames of one pulse, one for each camera of the rig; empty where a camera has none.
using SegmentedFrames = std::vector<std::optional<recorded::SegmentedFrame>>;

/// Repairs the masks of consecutive pulses. The result for a pulse depends on this pulse and its
/// two neighbours only, so shards of a take have the same result as the whole. One caller at a
/// time.
class TakeSilhouetteRepair {
 public:
  /// Throws InputError for options that the reconstruction rejects.
  TakeSilhouetteRepair(const Rig& rig, const recon::ReconstructOptions& options);

  /// Replaces the masks of `frames` by repaired ones, which are empty outside the view of the
  /// bounds. A camera with more wrong than right foreground loses its frame. A camera with a frame
  /// lag gets the raw frame in `next`, with its label; this is detected only if the last call was
  /// for `pulse` - 1. `next`: frames of the next pulse; their masks are limited to the view of the
  /// bounds.
  void repair(int64_t pulse, SegmentedFrames& frames, SegmentedFrames& next);

  /// Provides the pulse before the first call of repair(), without changing frames.
  void set_previous(int64_t pulse, SegmentedFrames frames);
  /// Whether the last call was for `pulse`.
  bool is_previous(int64_t pulse) const { return pulse == previous_pulse_; }

  const std::vector<PulseFault>& faults() const { return faults_; }

 private:
  std::vector<const Mask*> limit_to_view(SegmentedFrames& frames) const;
  recon::RepairedSilhouettes compare(const SegmentedFrames& frames,
                                     std::span<const Mask* const> masks,
                                     const recon::NeighbourMasks& neighbours);

  const Rig rig_;
  recon::SilhouetteRepair repair_;
  std::vector<Mask> views_;  ///< of the bounds, by camera
  int64_t previous_pulse_ = -2;
  std::vector<std::optional<Mask>> previous_;  ///< masks of that pulse, repaired without neighbours
  std::vector<PulseFault> faults_;
};

/// Repeats the silhouette repair of v3d-recond for given pulses, each by itself. One caller at a
/// time.
class LivePulseRepair {
 public:
  /// Requires ascending pulses. Throws InputError for options that the reconstruction rejects.
  LivePulseRepair(const Rig& rig, const recon::ReconstructOptions& options,
                  std::vector<int64_t> pulses);

  /// Repairs `set`, the observe_all() of `frames`, if its pulse is one of the given ones. `frames`
  /// gets the same masks, and loses the cameras that are left out.
  void repair(recon::FrameSet& set, SegmentedFrames& frames);

  const std::vector<PulseFault>& faults() const { return faults_; }

 private:
  const Rig rig_;
  recon::FrameSetRepair repair_;
  const std::vector<int64_t> pulses_;
  std::vector<PulseFault> faults_;
};

/// "cam07: 12 missing pieces, 1 phantom piece, left out of 2 frames", for each camera with faults.
std::vector<std::string> fault_lines(const std::vector<PulseFault>& faults);

// Surfaces, pulse by pulse.

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
