// Transitions between two actions whose poses are alike.
#pragma once

#include <cstddef>
#include <functional>

#include "recon/editing/clip.h"

namespace v3d::recon {

/// A transition: frames `at` + 1 to `at` + `blend` of the first action turn into frames `from` to
/// `from` + `blend` - 1 of the second one, which then continues.
struct SpliceTransition {
  size_t at = 0, from = 0, blend = 10;
  /// Root mean square distance of the joints in these frames, metres, once the second action stands
  /// where the first one does.
  double cost_m = 0;
};

/// The cheapest transition with `at` in a range of `a`, and `from` in a range of `b`; ranges are
/// cut at the ends of the clips. Calls `on_frame` before the work on each `at`; it may throw.
/// Requires clips of more than `blend` + 1 frames and blend >= 1.
///
/// Source: Kovar, Gleicher and Pighin, Motion graphs, SIGGRAPH 2002 (distance of windows of frames
/// after the best rotation about the vertical axis and shift along the floor).
SpliceTransition best_transition(const Clip& a, ClipRange at, const Clip& b, ClipRange from,
                                 size_t blend, const std::function<void()>& on_frame);

/// Continues `a` with `b` by a transition, whose frames must lie in the clips. In its first half
/// the surface of `a` is moved to the blended pose, in its second half that of `b`. The frames of
/// `b` are turned about the vertical axis and shifted along the floor to where `a` stands. A prop
/// stays in the hand of `a`. Returns the last frame with a surface of the first action.
size_t splice(Clip& a, Clip b, const SpliceTransition& transition);

/// Ratio of the surface speed at a change of the surface to that around it; 1 for a smooth change,
/// infinite where the surface stands still around it.
///
/// Numerator: median path of the vertices from frame `last` to the next one, metres. The path of a
/// vertex is that to the pose of the next frame, and from there to the nearest point of the surface
/// of that frame. Denominator: median of the same over the frames up to `around` before and after.
double relative_jump(const Clip& clip, size_t last, size_t around);

}  // namespace v3d::recon
