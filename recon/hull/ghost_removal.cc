#include "recon/hull/ghost_removal.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>

#include "recon/hull/brick_halo.h"

namespace v3d::recon {
namespace {

/// Number of voxels of a component whose lines of sight are tested.
constexpr size_t kSamples = 64;

/// Steps through the cells that a line passes. Source: Amanatides and Woo, "A fast voxel traversal
/// algorithm for ray tracing", 1987.
class LineTraversal {
 public:
  /// The line is origin + t direction; `cell`: edge of a cell in the unit of the line. Starts at t.
  LineTraversal(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction, double cell,
                double t) {
    for (int a = 0; a < 3; ++a) {
      const double at = (origin[a] + t * direction[a]) / cell;
      cell_[a] = static_cast<int>(std::floor(at));
      const double speed = direction[a] / cell;
      step_[a] = speed > 0 ? 1 : -1;
      const bool moves = std::abs(speed) > 1e-12;
      per_cell_[a] = moves ? 1 / std::abs(speed) : kNever;
      const double to_next = speed > 0 ? cell_[a] + 1 - at : at - cell_[a];
      next_[a] = moves ? t + to_next * per_cell_[a] : kNever;
    }
  }

  const std::array<int, 3>& cell() const { return cell_; }
  /// t where the line leaves the cell.
  double end() const { return *std::ranges::min_element(next_); }
  void advance() {
    const auto axis = static_cast<size_t>(std::ranges::min_element(next_) - next_.begin());
    cell_[axis] += step_[axis];
    next_[axis] += per_cell_[axis];
  }

 private:
  static constexpr double kNever = std::numeric_limits<double>::infinity();
  std::array<int, 3> cell_{};
  std::array<int, 3> step_{};
  std::array<double, 3> per_cell_{};
  std::array<double, 3> next_{};
};

/// The part of a line with t >= 0 inside a box from 0 to `counts`; begin > end when there is none.
struct Section {
  double begin = 0;
  double end = std::numeric_limits<double>::infinity();
};
Section inside(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction,
               const std::array<int64_t, 3>& counts) {
  Section section;
  for (int a = 0; a < 3; ++a) {
    if (direction[a] == 0) continue;
    const double near = -origin[a] / direction[a];
    const double far = (static_cast<double>(counts[a]) - origin[a]) / direction[a];
    section.begin = std::max(section.begin, std::min(near, far));
    section.end = std::min(section.end, std::max(near, far));
  }
  return section;
}

}  // namespace

GhostRemoval::GhostRemoval(const VoxelGrid& grid, std::span<const CameraModel> cameras,
                           const GhostOptions& options)
    : grid_(grid), cameras_(cameras.begin(), cameras.end()), options_(options) {
  for (const CameraModel& camera : cameras_) {
    eyes_.emplace_back((camera.center() - grid.origin) / grid.voxel_m);
  }
}

int GhostRemoval::remove(SparseVolume& volume, std::span<const uint8_t> takes_part) {
  components_.find(volume);
  if (components_.count() < 2) return 0;
  ignored_.assign(volume.bricks().size(), codec::kEmptyBrick);
  near_.resize(volume.bricks().size());
  std::vector<Candidate> open = candidates();
  size_t ghosts = 0;
  for (int missing = options_.min_proofs; missing > 0; --missing) {
    ghosts += std::erase_if(open, [&](Candidate& candidate) {
      // The removal of other ghosts only adds proofs.
      if (candidate.missing_proofs < missing) return false;
      return is_ghost(volume, candidate, takes_part, missing);
    });
  }
  if (ghosts == 0) return 0;
  std::vector<PlacedBrick> left(volume.bricks().size());
  for (size_t b = 0; b < left.size(); ++b) {
    left[b].at = volume.coords()[b];
    for (size_t z = 0; z < codec::kBrickEdge; ++z)
      left[b].bits[z] = volume.bricks()[b][z] & ~ignored_[b][z];
  }
  const std::span<const PlacedBrick> part(left);
  volume.assign(grid_, {&part, 1});
  return static_cast<int>(ghosts);
}

/// The components that may be ghosts, by ascending number of voxels.
std::vector<GhostRemoval::Candidate> GhostRemoval::candidates() const {
  const auto max_voxels = static_cast<int64_t>(options_.max_volume_m3 / grid_.voxel_volume_m3());
  const size_t largest = components_.largest();
  std::vector<Candidate> candidates;
  for (size_t c = 0; c < components_.count(); ++c) {
    if (c != largest && components_.voxels(c) < max_voxels)
      candidates.push_back({c, options_.min_proofs});
  }
  std::ranges::stable_sort(candidates, {},
                           [&](const Candidate& c) { return components_.voxels(c.component); });
  return candidates;
}

/// Counts the missing proofs of the candidate. True when at least `missing` are missing: then its
/// voxels stay in `ignored_`.
bool GhostRemoval::is_ghost(const SparseVolume& volume, Candidate& candidate,
                            std::span<const uint8_t> takes_part, int missing) {
  const auto parts = components_.parts(candidate.component);
  const auto flip = [&] {
    for (const ComponentPart& part : parts) {
      for (size_t z = 0; z < codec::kBrickEdge; ++z) ignored_[part.brick][z] ^= part.bits[z];
    }
  };
  flip();
  has_near_.assign(volume.bricks().size(), 0);
  sample(volume, candidate.component);
  candidate.missing_proofs = missing_proofs(volume, takes_part);
  if (candidate.missing_proofs >= missing) return true;
  flip();
  return false;
}

int GhostRemoval::missing_proofs(const SparseVolume& volume, std::span<const uint8_t> takes_part) {
  int proofs = 0, seeing = 0;
  for (size_t c = 0; c < cameras_.size(); ++c) {
    if (!takes_part[c]) continue;
    size_t seen = 0, met = 0;
    for (const Eigen::Vector3d& voxel : samples_) {
      const auto pixel = cameras_[c].project(grid_.origin + grid_.voxel_m * voxel);
      if (!pixel || !cameras_[c].inside_image(*pixel)) continue;
      ++seen;
      met += is_met(volume, eyes_[c], voxel) ? 1 : 0;
    }
    if (seen == 0) continue;
    ++seeing;
    if (2 * met <= seen) ++proofs;
  }
  return std::min(options_.min_proofs, (seeing + 1) / 2) - proofs;
}

/// Chooses voxels that are spread evenly over the component.
void GhostRemoval::sample(const SparseVolume& volume, size_t component) {
  samples_.clear();
  const auto voxels = static_cast<size_t>(components_.voxels(component));
  const size_t every = (voxels + kSamples - 1) / kSamples;
  size_t number = 0;
  for (const ComponentPart& part : components_.parts(component)) {
    const codec::BrickCoord at = volume.coords()[part.brick];
    for (int z = 0; z < codec::kBrickEdge; ++z) {
      for (uint64_t left = part.bits[z]; left != 0; left &= left - 1) {
        if (number++ % every != 0) continue;
        const int bit = std::countr_zero(left);
        const int x = bit % 8, y = bit / 8;
        samples_.emplace_back(codec::kBrickEdge * at.x + x + 0.5,
                              codec::kBrickEdge * at.y + y + 0.5,
                              codec::kBrickEdge * at.z + z + 0.5);
      }
    }
  }
}

/// Does the line of sight from `eye` through `voxel` meet another component, in front or behind?
bool GhostRemoval::is_met(const SparseVolume& volume, const Eigen::Vector3d& eye,
                          const Eigen::Vector3d& voxel) {
  const Eigen::Vector3d direction = voxel - eye;
  const Section section = inside(eye, direction, grid_.counts);
  LineTraversal brick(eye, direction, codec::kBrickEdge, section.begin);
  for (double t = section.begin; t < section.end; t = brick.end(), brick.advance()) {
    const auto [x, y, z] = brick.cell();
    const int index = volume.index_of({x, y, z});
    if (index < 0) continue;
    const codec::Brick& near = near_others(volume, static_cast<size_t>(index));
    if (near == codec::kEmptyBrick) continue;
    LineTraversal cell(eye, direction, 1, t);
    for (double u = t; u < brick.end(); u = cell.end(), cell.advance()) {
      const auto [i, j, k] = cell.cell();
      if ((i >> 3) != x || (j >> 3) != y || (k >> 3) != z) continue;
      if ((near[k & 7] >> (8 * (j & 7) + (i & 7)) & 1) != 0) return true;
    }
  }
  return false;
}

const codec::Brick& GhostRemoval::near_others(const SparseVolume& volume, size_t brick) {
  if (!has_near_[brick]) {
    const auto others_of = [&](size_t b, int z) { return volume.bricks()[b][z] & ~ignored_[b][z]; };
    near_[brick] = dilated(bricks_around(volume, brick), others_of);
    has_near_[brick] = 1;
  }
  return near_[brick];
}

}  // namespace v3d::recon
