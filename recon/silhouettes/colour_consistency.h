// Whether a piece of an image shows the surface that it is said to show, by its colours.
#pragma once

#include <memory>
#include <span>

#include "base/camera_model.h"
#include "base/frame.h"
#include "base/mask.h"
#include "base/mesh.h"

namespace v3d {

/// Places of a surface that could be compared, and those of them that look alike.
struct ColourAgreement {
  int compared = 0;
  int agreeing = 0;

  /// More agree than do where the camera looks past the surface: there, what lies behind it has
  /// the surface's colours by chance alone.
  bool is_consistent() const;
};

/// What one camera sees of a surface, and what cameras beside it see at the same places. Borrows
/// everything for as long as it lives; what it knows depends on nothing else. One thread.
class ColourConsistency {
 public:
  /// frames: one per camera of the rig, or null where there are no colours; `voxel_m`: how well
  /// the surface is known.
  ColourConsistency(const Rig& rig, std::span<const Frame* const> frames, size_t camera,
                    const Mesh& surface, double voxel_m);
  ~ColourConsistency();

  /// Of the places that the camera sees within `piece`: whether its image has the colours there
  /// that the cameras beside it agree about. Nothing is compared where colours are lacking.
  ColourAgreement within(const Mask& piece) const;

 private:
  class Views;
  std::unique_ptr<const Views> views_;  ///< null where the camera has no colours
};

}  // namespace v3d
