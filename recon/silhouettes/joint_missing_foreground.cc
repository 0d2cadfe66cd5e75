#include "recon/silhouettes/joint_missing_foreground.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cstdint>
#include <iterator>

namespace v3d {
namespace {

/// Unexplained foreground is counted in cells of this many pixels along each side.
constexpr int kCell = 4;

struct CameraPixel {
  size_t camera = 0;
  int x = 0;
  int y = 0;
};

/// The pixels of one voxel in all cameras.
struct Votes {
  std::vector<CameraPixel> missing;
  std::vector<CameraPixel> supporting;  ///< unexplained foreground
  int64_t showing = 0;                  ///< cameras that show foreground, explained or not
};

class VoxelTest {
 public:
  VoxelTest(std::span<const VoxelCamera> lenses, std::span<const Mask* const> masks,
            std::span<const Mask> unexplained, const JointMissingOptions& options)
      : lenses_(lenses),
        masks_(masks),
        unexplained_(unexplained),
        options_(options),
        max_missing_(part_of(static_cast<int64_t>(masks.size()))) {}

  /// True when a few cameras show background at the voxel, and enough support it.
  bool finds_lost(int i, int j, int k, Votes& votes) const {
    votes.missing.clear();
    votes.supporting.clear();
    votes.showing = 0;
    for (size_t c = 0; c < masks_.size(); ++c) {
      if (masks_[c] == nullptr) continue;
      const SeenPixel at = project_voxel(lenses_[c], i, j, k);
      if (!at.seen) continue;
      if (!masks_[c]->get(at.x, at.y)) {
        votes.missing.push_back({c, at.x, at.y});
        if (std::ssize(votes.missing) > max_missing_) return false;
        continue;
      }
      ++votes.showing;
      const bool supports = unexplained_[c].size().width > 0 && unexplained_[c].get(at.x, at.y);
      if (supports) votes.supporting.push_back({c, at.x, at.y});
    }
    const int64_t missing = std::ssize(votes.missing);
    return missing >= 2 && missing <= part_of(votes.showing + missing) &&
           votes.showing >= options_.min_views &&
           std::ssize(votes.supporting) >= options_.min_supporting &&
           std::ssize(votes.supporting) >= options_.supporting_per_missing * missing;
  }

 private:
  int64_t part_of(int64_t cameras) const {
    return static_cast<int64_t>(options_.max_missing_part * static_cast<double>(cameras));
  }

  std::span<const VoxelCamera> lenses_;
  std::span<const Mask* const> masks_;
  std::span<const Mask> unexplained_;
  const JointMissingOptions& options_;
  const int64_t max_missing_;  ///< the count stops here
};

std::vector<Votes> find_lost(const VoxelGrid& grid, const VoxelTest& test) {
  std::vector<std::vector<Votes>> slices(static_cast<size_t>(grid.counts[2]));
  tbb::parallel_for(size_t{0}, slices.size(), [&](size_t k) {
    Votes votes;
    for (int j = 0; j < grid.counts[1]; ++j) {
      for (int i = 0; i < grid.counts[0]; ++i) {
        if (test.finds_lost(i, j, static_cast<int>(k), votes)) slices[k].push_back(votes);
      }
    }
  });
  std::vector<Votes> lost;
  for (auto& slice : slices) std::move(slice.begin(), slice.end(), std::back_inserter(lost));
  return lost;
}

/// By camera and cell, the smallest number of background cameras of any voxel that explains the
/// foreground there.
class FewestWrong {
 public:
  FewestWrong(std::span<const Mask> unexplained, const std::vector<Votes>& lost) {
    for (const Mask& mask : unexplained) {
      width_.push_back(mask.size().width / kCell + 1);
      cells_.emplace_back(width_.back() * (mask.size().height / kCell + 1), ~size_t{0});
    }
    for (const Votes& votes : lost) {
      for (const CameraPixel& pixel : votes.supporting) {
        size_t& fewest = at(pixel);
        fewest = std::min(fewest, votes.missing.size());
      }
    }
  }

  /// Number of supporting cameras for which no voxel with fewer background cameras explains the
  /// foreground.
  int64_t need(const Votes& votes) {
    return std::ranges::count_if(votes.supporting, [&](const CameraPixel& pixel) {
      return at(pixel) == votes.missing.size();
    });
  }

 private:
  size_t& at(const CameraPixel& pixel) {
    const int cell = pixel.y / kCell * width_[pixel.camera] + pixel.x / kCell;
    return cells_[pixel.camera][static_cast<size_t>(cell)];
  }

  std::vector<int> width_;
  std::vector<std::vector<size_t>> cells_;
};

}  // namespace

std::vector<Mask> joint_missing_foreground(const VoxelGrid& grid,
                                           std::span<const VoxelCamera> lenses,
                                           std::span<const Mask* const> masks,
                                           std::span<const Mask> unexplained,
                                           const JointMissingOptions& options) {
  const std::vector<Votes> lost = find_lost(grid, VoxelTest(lenses, masks, unexplained, options));
  FewestWrong fewest(unexplained, lost);
  std::vector<Mask> missing(masks.size());
  for (const Votes& votes : lost) {
    if (fewest.need(votes) < options.min_supporting) continue;
    for (const CameraPixel& pixel : votes.missing) {
      Mask& mask = missing[pixel.camera];
      if (mask.size().width == 0) mask = Mask(masks[pixel.camera]->size());
      mask.set(pixel.x, pixel.y);
    }
  }
  return missing;
}

}  // namespace v3d
