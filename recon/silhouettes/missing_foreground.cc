#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <optional>
#include <vector>

#include "recon/silhouettes/silhouette_repair.h"
#include "recon/texture/texture.h"
#include "recon/visibility/depth_buffer.h"

namespace v3d::recon {
namespace {

/// Number of neighbours: the cameras with the most similar viewing directions.
constexpr size_t kNeighbours = 4;
constexpr double kSameSide = 0.2;  ///< smallest cosine between viewing directions
/// Factor by which depth buffers are smaller than the image.
constexpr int kReduction = 4;
constexpr double kToleranceVoxels = 3;
/// Largest difference of equal colours, grey values. The surface is accurate to some voxels only,
/// so means of patches are compared instead of pixels.
constexpr float kSameColour = 24;
constexpr int kPatch = 2;
constexpr int kStep = 3;
/// Smallest number of comparable points.
constexpr int kMinPoints = 12;
/// Part of the points that agree by chance where the camera sees past the surface. The mean is
/// 0.02; one in 40 pieces has more than this (v3d-silhouette-faults, seeds 401 to 405 and 411 to
/// 415).
constexpr double kByChance = 0.2;
/// Required excess over chance, in standard deviations of independent points. None of these 659
/// pieces exceeds 3.
constexpr double kDeviations = 3.5;

struct View {
  const RigCamera* camera = nullptr;
  const Frame* frame = nullptr;
  DepthBuffer depth;  ///< reduced
};

/// Mean of a patch of the image in the rig's common colour response, regardless of the mask; empty
/// where the frame has no pixels.
std::optional<Eigen::Vector3f> patch_colour(const RigCamera& camera, const Frame& frame,
                                            const Eigen::Vector2d& pixel) {
  Eigen::Vector3f sum = Eigen::Vector3f::Zero();
  for (int dy = -kPatch; dy <= kPatch; dy += kPatch) {
    for (int dx = -kPatch; dx <= kPatch; dx += kPatch) {
      const auto colour = sample_colour(frame.image.view(), pixel.x() + dx - frame.roi.x0,
                                        pixel.y() + dy - frame.roi.y0);
      if (!colour) return {};
      sum += *colour;
    }
  }
  return camera.colour.corrected((sum / 9).cast<double>()).cast<float>();
}

std::vector<View> neighbours_of(const Rig& rig, std::span<const Frame* const> frames, size_t camera,
                                const Mesh& surface) {
  const Eigen::Vector3d direction = rig[camera].model.viewing_direction();
  std::vector<std::pair<double, size_t>> near;
  for (size_t c = 0; c < rig.size(); ++c) {
    const double cosine = direction.dot(rig[c].model.viewing_direction());
    if (c != camera && frames[c] != nullptr && cosine > kSameSide) near.emplace_back(-cosine, c);
  }
  std::ranges::sort(near);
  std::vector<View> views;
  for (size_t n = 0; n < std::min(near.size(), kNeighbours); ++n) {
    const size_t c = near[n].second;
    views.push_back({&rig[c], frames[c], draw_depth(surface, rig[c].model.reduced(kReduction))});
  }
  return views;
}

/// Colour of a point in a view; empty where the point is hidden.
std::optional<Eigen::Vector3f> colour_at(const View& view, const Eigen::Vector3d& point,
                                         double tolerance_m) {
  const CameraModel& model = view.camera->model;
  const auto pixel = model.project(point);
  if (!pixel || !model.inside_image(*pixel)) return {};
  const double z = (model.cam_from_world() * point).z();
  const int x =
      std::min(static_cast<int>((pixel->x() + 0.5) / kReduction), view.depth.size.width - 1);
  const int y =
      std::min(static_cast<int>((pixel->y() + 0.5) / kReduction), view.depth.size.height - 1);
  if (z > view.depth.at(x, y) + tolerance_m) return {};
  return patch_colour(*view.camera, *view.frame, *pixel);
}

bool same(const Eigen::Vector3f& a, const Eigen::Vector3f& b) {
  return (a - b).cwiseAbs().maxCoeff() <= kSameColour;
}

/// True when the majority of the views, and at least two, agree with the camera; empty when fewer
/// than two see the point.
std::optional<bool> agree_with(const Eigen::Vector3f& own, std::span<const View> views,
                               const Eigen::Vector3d& point, double tolerance_m) {
  int seen = 0;
  int agreeing = 0;
  for (const View& view : views) {
    const auto colour = colour_at(view, point, tolerance_m);
    if (!colour) continue;
    ++seen;
    agreeing += same(own, *colour);
  }
  if (seen < 2) return {};
  return 2 * agreeing > seen && agreeing >= 2;
}

}  // namespace

class ColourConsistency::Views {
 public:
  Views(const Rig& rig, std::span<const Frame* const> frames, size_t camera, const Mesh& surface,
        double tolerance_m)
      : own_{&rig[camera], frames[camera],
             draw_depth(surface, rig[camera].model.reduced(kReduction))},
        others_(neighbours_of(rig, frames, camera, surface)),
        tolerance_m_(tolerance_m) {}

  /// Agreement at the point of the surface in this pixel; empty where it cannot be determined.
  std::optional<bool> agrees(int x, int y) const {
    const CameraModel& model = own_.camera->model;
    const Eigen::Vector2d pixel(x, y);
    const float z = own_.depth.at(std::min(x / kReduction, own_.depth.size.width - 1),
                                  std::min(y / kReduction, own_.depth.size.height - 1));
    if (!std::isfinite(z)) return {};
    const auto ray = model.ray(pixel);
    const auto colour = patch_colour(*own_.camera, *own_.frame, pixel);
    if (!ray || !colour) return {};
    const double along = z / model.viewing_direction().dot(*ray);
    return agree_with(*colour, others_, model.center() + along * *ray, tolerance_m_);
  }

 private:
  const View own_;
  const std::vector<View> others_;
  const double tolerance_m_;
};

ColourConsistency::ColourConsistency(const Rig& rig, std::span<const Frame* const> frames,
                                     size_t camera, const Mesh& surface, double voxel_m) {
  if (frames[camera] == nullptr) return;
  views_ = std::make_unique<const Views>(rig, frames, camera, surface, kToleranceVoxels * voxel_m);
}

ColourConsistency::~ColourConsistency() = default;

ColourAgreement ColourConsistency::within(const Mask& piece) const {
  ColourAgreement agreement;
  if (!views_) return agreement;
  const Rect box = piece.bounding_box();
  for (int y = box.y0; y < box.y0 + box.height; y += kStep) {
    for (int x = box.x0; x < box.x0 + box.width; x += kStep) {
      if (!piece.get(x, y)) continue;
      const auto result = views_->agrees(x, y);
      agreement.compared += result.has_value();
      agreement.agreeing += result.value_or(false);
    }
  }
  return agreement;
}

bool ColourAgreement::is_consistent() const {
  const double by_chance = kByChance * compared;
  return compared >= kMinPoints &&
         agreeing > by_chance + kDeviations * std::sqrt(by_chance * (1 - kByChance));
}

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

std::vector<Votes> find_lost(const VoxelGrid& grid, const VoxelTest& test,
                             const StopRequest& should_stop) {
  std::vector<std::vector<Votes>> slices(static_cast<size_t>(grid.counts[2]));
  tbb::parallel_for(size_t{0}, slices.size(), [&](size_t k) {
    if (should_stop && should_stop()) return;
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
  const std::vector<Votes> lost =
      find_lost(grid, VoxelTest(lenses, masks, unexplained, options), options.should_stop);
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

}  // namespace v3d::recon
