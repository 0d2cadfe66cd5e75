#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include "recon/hull/intersect.h"
#include "support/instruction_sets.h"
#include "tests/recon/random_rig.h"

namespace v3d::recon {
namespace {

const VoxelGrid kGrid{{-1.5, -1.5, 0}, 0.008, {375, 371, 250}};

OctreeNode random_node() {
  OctreeNode node;
  node.level = *rc::gen::element(1, 1, 2, 3);
  const int edge = 1 << node.level;
  const auto coordinate = [&](int axis) {
    return edge * uniform_int(0, static_cast<int>(kGrid.counts[axis]) / (8 * edge) + 1);
  };
  node.at = {coordinate(0), coordinate(1), coordinate(2)};
  return node;
}

/// Some voxels of a child of a node, all of its corners among them.
template <class Visit>
void for_some_voxels(const OctreeNode& node, int child, const Visit& visit) {
  const int edge = 4 << node.level;
  const int step = std::max(1, edge / 8);
  const auto first = [&](int brick, int bit) { return 8 * brick + (child >> bit & 1) * edge; };
  const auto next = [&](int at, int begin) {
    return at == begin + edge - 1 ? at + 1 : std::min(at + step, begin + edge - 1);
  };
  const int i0 = first(node.at.x, 0);
  const int j0 = first(node.at.y, 1);
  const int k0 = first(node.at.z, 2);
  for (int k = k0; k < k0 + edge; k = next(k, k0)) {
    for (int j = j0; j < j0 + edge; j = next(j, j0)) {
      for (int i = i0; i < i0 + edge; i = next(i, i0)) {
        if (kGrid.contains(i, j, k)) visit(i, j, k);
      }
    }
  }
}

void require_true_of_every_voxel(const CubeFootprint& view, const SeenPixel& pixel) {
  if (!view.may_see) RC_ASSERT(!pixel.seen);
  if (view.sees_all) RC_ASSERT(pixel.seen);
  if (!view.is_known || !pixel.seen) return;
  RC_ASSERT(view.x0 <= pixel.x && pixel.x <= view.x1);
  RC_ASSERT(view.y0 <= pixel.y && pixel.y <= view.y1);
}

RC_GTEST_PROP(IntersectionOctree, bounds_of_a_cube_hold_for_each_of_its_voxels, ()) {
  const CameraModel model = random_camera(box_of(kGrid));
  const std::vector<VoxelCamera> cameras{VoxelCamera(model, kGrid)};
  std::vector<MaskPyramid> masks(1, MaskPyramid(model.size()));
  const IntersectionScene scene{kGrid, cameras, masks, 1};
  const OctreeNode node = random_node();
  on_every_instruction_set([&] {
    const auto views = child_footprints(scene, node, 0);
    for (int child = 0; child < 8; ++child) {
      for_some_voxels(node, child, [&](int i, int j, int k) {
        require_true_of_every_voxel(views[child], project_voxel(cameras[0], i, j, k));
      });
    }
  });
}

RC_GTEST_PROP(IntersectionOctree, gives_no_bounds_where_numbers_may_overflow, ()) {
  const CameraModel usual = random_camera(box_of(kGrid));
  const CameraModel wild(usual.size(), usual.matrix(), Distortion{0, 0, 0, 0, 1e30},
                         usual.cam_from_world());
  const std::vector<VoxelCamera> cameras{VoxelCamera(wild, kGrid)};
  std::vector<MaskPyramid> masks(1, MaskPyramid(wild.size()));
  const auto views = child_footprints({kGrid, cameras, masks, 1}, random_node(), 0);
  for (const CubeFootprint& view : views) RC_ASSERT(!view.is_known);
}

}  // namespace
}  // namespace v3d::recon
