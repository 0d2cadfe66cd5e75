// An action that can be edited: tracked surfaces with a skin, and skeletons that move them.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string_view>
#include <vector>

#include "base/geometry/mesh.h"
#include "recon/skeleton/tracked_skeleton.h"

namespace v3d::recon {

/// Triangles and skin of a tracked surface.
struct ClipSurface {
  std::vector<std::array<uint32_t, 3>> triangles;
  Skin skin;
};

/// One frame of an action. World frame, metres, z up.
struct ClipFrame {
  size_t surface = 0;                      ///< index of Clip::surfaces
  std::vector<Eigen::Vector3f> positions;  ///< [vertex]
  std::vector<Rgb8> colours;               ///< [vertex], or none
  SkeletonPulse skeleton;                  ///< its index has no meaning here
};

/// An action of one performer. Operations number its frames from 0.
struct Clip {
  double rate_hz = 25;
  std::vector<ClipSurface> surfaces;
  std::vector<ClipFrame> frames;
  Joint prop_hand = kRightWrist;  ///< the wrist of the hand that holds the prop
};

/// Frames first to last - 1.
struct ClipRange {
  size_t first = 0, last = 0;
};

/// The joint of this name (name(Joint)); empty for another text.
std::optional<Joint> find_joint(std::string_view text);

/// A skeleton between `a` (share 0) and `b` (share 1): joints on straight lines, rotations by
/// spherical interpolation.
SkeletonPulse blended(const SkeletonPulse& a, const SkeletonPulse& b, double share);

/// A frame between `a` (share 0) and `b` (share 1): vertices on straight lines where both have one
/// surface, otherwise the nearer frame with the blended() skeleton. `clip` has their surfaces.
ClipFrame frame_between(const Clip& clip, const ClipFrame& a, const ClipFrame& b, double share);

/// Moves the surface of a frame from its skeleton to another one; details stay, because only the
/// difference of the two skeletons acts through the skin.
void pose(const Clip& clip, ClipFrame& frame, const SkeletonPulse& skeleton);

/// Keeps only these frames. Requires a range that is not empty and lies in the clip, as do the
/// other operations.
void cut(Clip& clip, ClipRange range);

/// Changes the duration of a range by `factor`, from 0.1 to 10. New frames lie between two old
/// ones.
void stretch(Clip& clip, ClipRange range, double factor);
/// The number of frames of which stretch() makes `frames`.
size_t stretched_frames(size_t frames, double factor);
/// The last of these whose surface is that of one of the first `frame` + 1 of the range.
size_t stretched_frame(size_t frames, double factor, size_t frame);

/// Exchanges left and right, also the hand that holds the prop: a reflection in the vertical plane
/// through the middle of all pelvis positions, across the mean direction from the right to the left
/// hip.
void mirror(Clip& clip);

/// A joint that is rotated over a range of frames.
struct Bend {
  Joint joint = kLeftElbow;
  ClipRange range;
  double radians = 0;
  /// In the frame of the joint: x forward, y to the left, z along the bone. Unit vector.
  Eigen::Vector3d axis = Eigen::Vector3d::UnitY();
  size_t ramp = 0;  ///< frames at both ends in which the angle grows from 0 smoothly
};

/// Rotates a joint and its descendants.
void bend(Clip& clip, const Bend& bend);
/// Does a bend of this joint move vertices in the range? A wrist without a prop and the tip of a
/// prop move none, because no part of the surface hangs on them.
bool moves_surface(const Clip& clip, Joint joint, ClipRange range);

/// Gives a clip without a prop that of another clip, so that both can be blended: in every frame it
/// has the position in the hand that it has in `held`. `hand`: the wrist of that hand. Its
/// confidence is 0.
void carry_prop(Clip& clip, const SkeletonPulse& held, Joint hand);

/// Rises smoothly from 0 at t <= 0 to 1 at t >= 1.
double smooth_step(double t);

// Retargeting: an action shown by another performer.

/// Shows the action of `clip` by the performer of another clip: its surface in frame `shown` is
/// posed by the rotations of the action, with the bones that it has there. Positions of the pelvis
/// are scaled by the ratio of the lengths of the legs, from the point of the floor (z = 0) below
/// the first one, so that steps fit the legs. A prop is that of the other performer. The clip gets
/// the surface and the colours of that one frame. Requires a clip with a frame, and `shown` in
/// `performer`.
///
/// Source: Gleicher, Retargetting motion to new characters, SIGGRAPH 1998, for the problem; here
/// rotations are copied, and contacts are left to hold_feet().
void swap_performer(Clip& clip, const Clip& performer, size_t shown);

}  // namespace v3d::recon
