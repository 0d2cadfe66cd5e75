// Silhouette repair of a live take under load control, with counts and the list of repaired pulses.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "base/image/image.h"
#include "daemon/recond/repair_load_control.h"
#include "recon/pipeline/frame_set_repair.h"
#include "take/logs/repaired_pulses.h"

namespace v3d::recond {

/// Repairs of one camera in a take.
struct CameraRepairs {
  int64_t pulses = 0;       ///< with a repair of this camera
  int64_t pixels = 0;       ///< of all its faults
  int64_t left_out = 0;     ///< of `pulses`, those without the camera
  int64_t last_pulse = 0;   ///< of `pulses`
  std::string last_kind;    ///< of the largest fault in that pulse (name())
  Rect last_region;         ///< of this fault, pixels
  int64_t last_pixels = 0;  ///< of this fault
};

struct RepairCounts {
  int64_t checked = 0;                           ///< pulses whose repair was not stopped
  int64_t repaired = 0;                          ///< of these, pulses with a changed silhouette
  int64_t unchecked = 0;                         ///< pulses left out for lack of time
  int64_t stopped = 0;                           ///< of these, pulses whose repair was stopped
  int64_t write_errors = 0;                      ///< repaired pulses that are not in the list
  std::map<std::string, CameraRepairs> cameras;  ///< with repairs
};

/// Repairs the silhouettes of the pulses for which RepairLoadControl finds time. The result for a
/// pulse depends on its frame set only (FrameSetRepair), so `v3dctl reconstruct --repair-pulses`
/// makes the same mesh.
class LiveRepair {
 public:
  struct Setup {
    std::vector<std::string> cameras;  ///< of the rig, in its order
    std::filesystem::path list;        ///< of the repaired pulses (RepairedPulsesWriter)
    /// FrameSetRepair::repair().
    std::function<std::optional<recon::RepairedFrameSet>(recon::FrameSet&,
                                                         const recon::StopRequest&)>
        repair;
  };
  /// `waiting`: returns the number of sets that wait behind the current one. Thread-safe.
  LiveRepair(Setup setup, std::function<size_t()> waiting);

  struct Result {
    bool started = false;  ///< it took time
    std::vector<recon::ReplacedMask> replaced{};
  };
  /// Repairs the masks of `set` if there is time. One thread.
  Result run(recon::FrameSet& set);
  /// Repairs a set that has no mesh, to allocate memory. The same thread.
  void warm_up(recon::FrameSet& set);
  /// Adds a pulse to the list: its mesh, with repaired silhouettes, was published. One thread.
  void record(int64_t pulse);

  RepairCounts counts() const;  ///< any thread

 private:
  std::optional<recon::RepairedFrameSet> repair(recon::FrameSet& set);
  void count(int64_t pulse, const std::vector<recon::SilhouetteFault>& faults);

  const Setup setup_;
  const std::function<size_t()> waiting_;
  RepairLoadControl load_;
  take::RepairedPulsesWriter list_;
  mutable std::mutex mutex_;  ///< guards counts_
  RepairCounts counts_;
};

/// "missing piece of 1,532 pixels, in the region 60 x 82 at x 104, y 220".
std::string text_of_last_fault(const CameraRepairs& repairs);

}  // namespace v3d::recond
