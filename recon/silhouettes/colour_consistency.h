// Colour consistency test: do other cameras see the same colours at a place where one camera
// reports background?
#pragma once

#include <memory>
#include <span>

#include "base/geometry/camera_model.h"
#include "base/geometry/mesh.h"
#include "base/image/frame.h"
#include "base/image/mask.h"

namespace v3d {

/// Number of places that could be compared, and of those that agree.
struct ColourAgreement {
  int compared = 0;
  int agreeing = 0;

  /// True when significantly more places agree than by chance. A camera that sees past the surface
  /// agrees by chance only.
  bool is_consistent() const;
};

/// Compares one camera with its neighbours on a surface. Borrows all arguments while it lives. One
/// thread.
class ColourConsistency {
 public:
  /// `frames` has one entry per camera of the rig, null where there are no colours. `surface` is
  /// accurate to some voxels of `voxel_m` metres.
  ColourConsistency(const Rig& rig, std::span<const Frame* const> frames, size_t camera,
                    const Mesh& surface, double voxel_m);
  ~ColourConsistency();

  /// Compares the places of the surface that the camera sees within `piece` with the majority of
  /// its neighbours. The result is empty where the camera has no colours.
  ColourAgreement within(const Mask& piece) const;

 private:
  class Views;
  std::unique_ptr<const Views> views_;  ///< null: the camera has no colours
};

}  // namespace v3d
