// What is right and wrong about a reconstruction, to be seen.
#pragma once

#include <vector>

#include "v3dctl/evaluate/held_out_view.h"

namespace v3d::ctl {

/// The colours of the errors, evenly from 0 to kWorstErrorMm; what is worse has the last.
inline constexpr double kWorstErrorMm = 20;
inline constexpr Rgb8 kErrorColours[] = {
    {49, 100, 180}, {116, 183, 215}, {245, 240, 190}, {247, 158, 85}, {200, 30, 40}};

/// The mesh in the colours of its distance from the truth, from four sides. The cameras stand round
/// the truth, so that pictures of several meshes are of the same places.
std::vector<Image> painted_errors(const Mesh& mesh, const Mesh& truth);

/// The pictures of a HeldOutView, cut down to the person.
class HeldOutPicture {
 public:
  /// Requires a mask with foreground. `camera` is borrowed.
  HeldOutPicture(const RigCamera& camera, const SegmentedFrame& frame);
  Image photograph() const;
  /// The mesh as the camera would have photographed it, with the colours that it has.
  Image rendering(const Mesh& mesh) const;
  /// How far the two are apart inside the silhouette: from black to white for 64 grey values and
  /// more.
  Image difference(const Mesh& mesh) const;

 private:
  Image cut(const Image& whole) const;

  const HeldOutView view_;
  const Rect place_;
};

}  // namespace v3d::ctl
