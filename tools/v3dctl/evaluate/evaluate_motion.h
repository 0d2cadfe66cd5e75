// Evaluation of a tracked surface: how far it carries points from where they truly are.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <vector>

#include "recon/metrics/motion_error.h"
#include "v3dctl/evaluate/evaluate.h"

namespace v3d::ctl {

struct CarriedReport {
  int64_t pulses = 0;  ///< since the first
  recon::EndPointError all, sleeves, sword;
  /// Nearest-point propagation over mesh.v3d instead of the tracked surface.
  std::optional<recon::EndPointError> nearest_point;
};

/// Carries the points of `truth`/points from the first pulse to the others. Points count that some
/// camera sees at some of these pulses. From one segment to the next, points change over at the
/// pulse that both share; without one, they keep their velocity for one pulse.
struct MotionReport {
  int64_t first_pulse = 0;
  int64_t segments = 0;
  double mean_segment_pulses = 0;
  double bound =
      0;  ///< part of the seen points that lies on the tracked surface at the first pulse
  std::vector<CarriedReport> carried;  ///< after every 25 pulses, and at the end
};

/// Empty when `evaluated` is no motion file, or the truth has no points. Throws InputError for
/// files that cannot be read, for points without colours, and after an interrupt.
std::optional<MotionReport> evaluate_motion(const EvaluatedMeshes& evaluated,
                                            const std::filesystem::path& truth);

}  // namespace v3d::ctl
