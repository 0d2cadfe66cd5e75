// Tracked surfaces of a take, and the file motion.v3d that holds them.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "codec/motion_header.h"
#include "recon/motion/motion_tracker.h"
#include "take/take.h"
#include "v3dctl/motion/pulse_source.h"

namespace v3d::ctl {

struct TrackRequest {
  /// A reconstructed take; or, with `out`, a folder with one mesh (.obj, .ply) per pulse.
  std::filesystem::path input;
  /// Where the result goes; empty: motion.v3d of the take.
  std::filesystem::path out;
  bool meshes_only = false;  ///< `input` is a folder of meshes
  double height_m = 0;       ///< see open_mesh_folder(); 0: metres
  take::FrameRange frames;
  recon::TrackingOptions tracking;
  double step_m = 0.0005;  ///< of the coded positions
  int threads = 0;         ///< 0: one per core. The result does not depend on it.
  uint64_t max_bytes = codec::MotionLimits::kFileBytes;  ///< of the file
};

struct TrackedSegmentReport {
  int64_t first = 0, last = 0, key = 0;  ///< pulses
  int64_t pulses = 0;
  int64_t vertices = 0, triangles = 0;
  double residual_p50_mm = 0, residual_p90_mm = 0;                  ///< medians over the pulses
  double far = 0;                                                   ///< largest of all pulses
  int64_t matched_patches = 0;                                      ///< median over the pulses
  double patch_correlation = 0;                                     ///< median over the pulses
  std::vector<std::pair<int64_t, recon::PulseResidual>> residuals;  ///< of each pulse
};

struct UntrackedReport {
  int64_t first = 0, last = 0;  ///< pulses
  std::string reason;
};

struct TrackReport {
  int64_t pulses = 0;  ///< of the input
  std::vector<TrackedSegmentReport> segments;
  std::vector<UntrackedReport> untracked;
  /// Pulses without images in segments that have images of others: they have the colours of the
  /// nearest pulse with images. Ascending.
  std::vector<int64_t> without_images;
  /// The first pulse for which the file has no room. It and all later ones are not in the file.
  std::optional<int64_t> full_from;
  bool is_unfinished = false;            ///< mesh.v3d has no index: pulses may be missing
  std::vector<std::string> read_errors;  ///< of the logs: lines with path and cause
  int64_t bytes = 0;                     ///< of the file
  /// Of the parts of the file: triangles and templates, positions, colours, confidences.
  int64_t template_bytes = 0, position_bytes = 0, colour_bytes = 0, confidence_bytes = 0;
  double seconds = 0;
  double peak_rss_mb = 0;
};

/// Tracks the surface of a take through its pulses (recon::track_motion()) and writes it with the
/// colours of each pulse. Calls `on_begin` with the number of pulses, and `on_pulse` before work on
/// each; a pulse has several turns. A file that would be longer than TrackRequest::max_bytes ends
/// before that.
///
/// Throws InputError for a take without meshes, without a surface in any pulse, or that is being
/// recorded, and other bad input; std::runtime_error for errors of the disk and after an interrupt.
/// Then an older file stays.
TrackReport track_take(const TrackRequest& request,
                       const std::function<void(int64_t pulses)>& on_begin,
                       const std::function<void()>& on_pulse);

// Steps of track_take(), also for sharded_tracking.h.

/// Throws as open_take_pulses() and open_mesh_folder().
std::unique_ptr<ObservedPulses> open_input(const TrackRequest& request);
/// `input` is borrowed.
recon::TakeSource source_of(ObservedPulses& input);
/// Calls `on_pulse`, which is borrowed, and throws std::runtime_error after an interrupt.
recon::OnPulse interruptible(const std::function<void()>& on_pulse);
/// Throws InputError where the steps of motion.v3d do not reach from the middle of the first
/// surface that is not empty to its ends: before the tracking, which takes seconds a pulse.
void require_steps(const TrackRequest& request, ObservedPulses& input);
/// Throws the InputError for an input without a surface in any pulse.
[[noreturn]] void reject_without_surface(const TrackRequest& request);
/// Replaces the result. Throws std::runtime_error for errors of the disk.
void write_motion(const TrackRequest& request, const std::string& bytes);
/// The requested number, otherwise one per core.
int tracking_threads(int requested);

}  // namespace v3d::ctl
