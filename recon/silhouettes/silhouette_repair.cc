#include "recon/silhouettes/silhouette_repair.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <utility>

#include "base/image/mask_operations.h"
#include "recon/render/renderer.h"
#include "recon/silhouettes/frame_lag.h"

namespace v3d::recon {
namespace {

/// Unexplained foreground is counted in cells of this many pixels along each side.
constexpr int kCell = 4;
/// A piece is needed when this many cells of this many other cameras need it. Fewer cells, or cells
/// at different places, may belong to a detail finer than a voxel.
constexpr int64_t kMinCells = 4;
constexpr int kMinCameras = 2;
/// Smallest area of a defect, in squares with sides of twice the radius of the camera.
constexpr int kMinSquares = 2;
/// With colour evidence, a piece may be narrower by this factor.
constexpr int kNarrower = 2;
/// A camera is left out when this part of its expected silhouette is missing, or when its phantoms
/// exceed the expected silhouette by this part.
constexpr double kMostlyWrong = 0.5;
/// Largest number of single repairs, one camera each.
constexpr int kIterations = 8;
/// Largest number of repairs of joint missing foreground.
constexpr int kJointIterations = 3;
/// Limit of voxels along the longest edge of the bounds.
constexpr double kMaxVoxels = 220;

/// Width of a voxel in pixels at the centre of the bounds.
double pixels_per_voxel(const CameraModel& camera, const Box& bounds, double voxel_m) {
  const Eigen::Vector3d middle = 0.5 * (bounds.min + bounds.max);
  const double distance = (camera.center() - middle).norm();
  return camera.matrix()(0, 0) * voxel_m / std::max(distance, voxel_m);
}

/// The box enlarged by a quarter of its size on every side.
Box wider(const Box& box) {
  const Eigen::Vector3d margin = 0.25 * box.size();
  return {box.min - margin, box.max + margin};
}

/// Calls visit(i, j, k) for the voxels of `a` that `b` does not have. Requires the same grid.
template <class Visit>
void for_each_added(const SparseVolume& a, const SparseVolume& b, Visit&& visit) {
  for (size_t n = 0; n < a.bricks().size(); ++n) {
    const codec::BrickCoord at = a.coords()[n];
    const int other = b.index_of(at);
    for (int z = 0; z < codec::kBrickEdge; ++z) {
      uint64_t more = a.bricks()[n][z] & ~(other >= 0 ? b.bricks()[other][z] : 0);
      for (; more != 0; more &= more - 1) {
        const int bit = std::countr_zero(more);
        visit(codec::kBrickEdge * at.x + bit % codec::kBrickEdge,
              codec::kBrickEdge * at.y + bit / codec::kBrickEdge, codec::kBrickEdge * at.z + z);
      }
    }
  }
}

int64_t min_pixels(int radius) {
  const int64_t edge = 2 * radius + 1;
  return kMinSquares * edge * edge;
}

Mask mask_of(const MaskComponents& pieces, size_t piece, ImageSize size) {
  Mask mask(size);
  pieces.for_each_run(piece, [&](const Run& run) {
    mask.fill_row(run.y, run.begin, run.end);
    return true;
  });
  return mask;
}

/// Connected pieces of a mask that are wider than 2 * radius pixels and have at least
/// min_pixels(radius).
std::vector<Mask> wide_pieces(const Mask& mask, int radius) {
  const int64_t min_area = min_pixels(radius);
  MaskComponents pieces;
  pieces.find(open(mask, radius));
  std::vector<Mask> wide;
  for (size_t p = 0; p < pieces.count(); ++p) {
    if (pieces.area(p) < min_area) continue;
    wide.push_back(intersection_of(dilate(mask_of(pieces, p, mask.size()), radius), mask));
  }
  return wide;
}

}  // namespace

std::string_view name(SilhouetteFaultKind kind) {
  switch (kind) {
    case SilhouetteFaultKind::kMissingPiece:
      return "missing piece";
    case SilhouetteFaultKind::kPhantomPiece:
      return "phantom piece";
    case SilhouetteFaultKind::kWholeCamera:
      return "whole camera";
    case SilhouetteFaultKind::kPulseLate:
      return "pulse late";
  }
  return "";
}

/// The silhouettes of one pulse during repair.
class SilhouetteRepair::Trial {
 public:
  Trial(SilhouetteRepair& owner, std::span<const Mask* const> masks,
        std::span<const Frame* const> frames, const NeighbourMasks& neighbours,
        StopRequest should_stop = {})
      : owner_(owner),
        given_(masks),
        frames_(frames),
        neighbours_(neighbours),
        should_stop_(std::move(should_stop)) {
    for (const Mask* mask : masks) masks_.push_back(mask ? std::optional(*mask) : std::nullopt);
    expected_.resize(masks.size());
  }

  RepairedSilhouettes run() {
    drop_blind_cameras();
    fill_missing_pieces();
    for (int iteration = 0; iteration < kJointIterations && fill_jointly_missing_pieces();
         ++iteration) {
      fill_missing_pieces();
    }
    std::optional<Trial> alone;
    if (!neighbours_.before.empty()) {
      alone.emplace(*this);
      // Without a late camera both results are the same.
      if (!repair_late_cameras()) alone.reset();
    }
    remove_phantom_pieces();
    if (alone) alone->remove_phantom_pieces();
    std::ranges::stable_sort(faults_, {}, &SilhouetteFault::camera);
    std::ranges::sort(shown_later_);
    std::vector<std::optional<Mask>> masks_alone = alone ? std::move(alone->masks_) : masks_;
    return {std::move(masks_), std::move(masks_alone), std::move(shown_later_), std::move(faults_)};
  }

  /// Was the repair stopped? Then the result of run() is incomplete.
  bool is_stopped() const { return stopped_; }

 private:
  bool must_stop() {
    stopped_ = stopped_ || (should_stop_ && should_stop_());
    return stopped_;
  }

  std::vector<const Mask*> all() const {
    std::vector<const Mask*> masks;
    for (const auto& mask : masks_) masks.push_back(mask ? &*mask : nullptr);
    return masks;
  }
  int radius(size_t camera) const { return owner_.radii_[camera]; }
  double voxel_m() const { return owner_.hulls_.grid().voxel_m; }

  /// Silhouette of the leave-one-out hull. Computed once, and again after another mask changed.
  const Mask& expected(size_t camera) {
    Mask& mask = expected_[camera];
    if (mask.size().width == 0) mask = owner_.hulls_.silhouette(all(), camera);
    return mask;
  }
  /// Replaces a mask. All changes of masks go through here.
  void put(size_t camera, std::optional<Mask> mask) {
    masks_[camera] = std::move(mask);
    for (size_t c = 0; c < expected_.size(); ++c) {
      if (c != camera) expected_[c] = Mask();
    }
  }

  void report(size_t camera, SilhouetteFaultKind kind, const Mask& where) {
    faults_.push_back({camera, kind, where.bounding_box(), where.count()});
  }

  /// Replaces all reported defects of this camera by one.
  void report_instead(size_t camera, SilhouetteFaultKind kind, const Mask& where) {
    std::erase_if(faults_, [&](const SilhouetteFault& fault) { return fault.camera == camera; });
    report(camera, kind, where);
  }

  void drop(size_t camera, const Mask& where) {
    report_instead(camera, SilhouetteFaultKind::kWholeCamera, where);
    put(camera, {});
  }

  /// Drops cameras with empty masks. One of them makes the volume empty, and each of two makes the
  /// leave-one-out hull of the other empty.
  void drop_blind_cameras() {
    std::vector<size_t> blind;
    for (size_t c = 0; c < masks_.size(); ++c) {
      if (masks_[c] && masks_[c]->count() == 0) blind.push_back(c);
    }
    if (blind.empty() || 2 * blind.size() > masks_.size()) return;
    std::vector<const Mask*> others = all();
    for (const size_t c : blind) others[c] = nullptr;
    const std::vector<Mask> expected = owner_.hulls_.silhouettes(others);
    for (const size_t c : blind) {
      if (expected[c].count() >= min_pixels(radius(c))) drop(c, expected[c]);
    }
  }

  /// Finds the foreground of each camera outside the silhouette of the volume, without narrow
  /// parts.
  void find_unexplained() {
    const auto masks = all();
    const std::vector<Mask> explained = owner_.hulls_.silhouettes(masks);
    unexplained_.assign(masks_.size(), Mask());
    for (size_t c = 0; c < masks_.size(); ++c) {
      if (!masks_[c]) continue;
      Mask unexplained = open(difference_of(*masks_[c], explained[c]), radius(c));
      if (unexplained.count() >= kMinCells * kCell * kCell) {
        unexplained_[c] = std::move(unexplained);
      }
    }
  }
  bool has_unexplained(size_t camera) const { return unexplained_[camera].size().width > 0; }

  /// Missing pieces of one camera.
  struct MissingPieces {
    size_t camera = 0;
    int64_t pixels = 0;
    std::vector<Mask> pieces;
  };

  void fill_missing_pieces() {
    for (int iteration = 0; iteration < kIterations && fill_most_missing_pieces(); ++iteration)
      continue;
  }

  /// Fills the pieces of the camera with the most missing pixels. A bad silhouette makes other
  /// cameras seem to lack pieces too, so one camera is filled at a time. False when there was
  /// nothing to fill.
  bool fill_most_missing_pieces() {
    find_unexplained();
    const SparseVolume hull = owner_.hulls_.volume(all());
    MissingPieces largest;
    for (size_t c = 0; c < masks_.size(); ++c) {
      if (must_stop()) return false;
      if (!masks_[c]) continue;
      MissingPieces missing = missing_pieces(c, hull);
      if (missing.pixels > largest.pixels) largest = std::move(missing);
    }
    if (largest.pixels > 0) fill(largest);
    return largest.pixels > 0;
  }

  void fill(const MissingPieces& missing) {
    Mask mask = std::move(*masks_[missing.camera]);
    for (const Mask& piece : missing.pieces) {
      report(missing.camera, SilhouetteFaultKind::kMissingPiece, piece);
      mask = union_of(std::move(mask), piece);
    }
    put(missing.camera, std::move(mask));
    const Mask& whole = expected(missing.camera);
    if (static_cast<double>(missing.pixels) > kMostlyWrong * static_cast<double>(whole.count())) {
      drop(missing.camera, whole);
    }
  }

  /// Fills joint missing foreground. False when there was nothing to fill.
  bool fill_jointly_missing_pieces() {
    if (must_stop()) return false;
    find_unexplained();
    const JointMissingOptions options{.min_views = owner_.min_views_, .should_stop = should_stop_};
    int cameras = 0;
    for (size_t c = 0; c < masks_.size(); ++c) cameras += has_unexplained(c);
    if (cameras < options.min_supporting) return false;
    const std::vector<Mask> missing = joint_missing_foreground(owner_.hulls_.grid(), owner_.lenses_,
                                                               all(), unexplained_, options);
    if (must_stop()) return false;
    bool filled = false;
    for (size_t c = 0; c < masks_.size(); ++c) {
      if (missing[c].size().width > 0) filled |= fill_wide_pieces(c, missing[c]);
    }
    return filled;
  }

  bool fill_wide_pieces(size_t camera, const Mask& missing) {
    const Mask lost = difference_of(dilate(missing, radius(camera)), *masks_[camera]);
    const std::vector<Mask> pieces = wide_pieces(lost, radius(camera));
    for (const Mask& piece : pieces) {
      report(camera, SilhouetteFaultKind::kMissingPiece, piece);
      put(camera, union_of(std::move(*masks_[camera]), piece));
    }
    return !pieces.empty();
  }

  MissingPieces missing_pieces(size_t camera, const SparseVolume& hull) {
    const Mesh& surface = owner_.hulls_.surface(all(), camera);
    expected_[camera] = draw_silhouette(surface, owner_.rig_[camera].model);
    Mask inside = difference_of(expected_[camera], *masks_[camera]);
    MissingPieces missing{.camera = camera, .pieces = {}};
    const auto take = [&](Mask piece) {
      inside = difference_of(std::move(inside), piece);
      missing.pixels += piece.count();
      missing.pieces.push_back(std::move(piece));
    };
    std::optional<ColourConsistency> consistency;
    const auto is_consistent = [&](const Mask& piece) {
      if (!consistency) consistency.emplace(owner_.rig_, frames_, camera, surface, voxel_m());
      return consistency->within(piece).is_consistent();
    };
    for (Mask& piece : wide_pieces(inside, radius(camera))) {
      if (is_consistent(piece) || is_needed(camera, piece, hull)) take(std::move(piece));
    }
    for (Mask& piece : wide_pieces(inside, radius(camera) / kNarrower)) {
      if (is_consistent(piece)) take(std::move(piece));
    }
    return missing;
  }

  /// True when voxels inside `piece` that only this camera removes would explain foreground of
  /// other cameras.
  bool is_needed(size_t camera, const Mask& piece, const SparseVolume& hull) {
    int64_t others = 0;
    for (size_t c = 0; c < masks_.size(); ++c) others += c != camera && has_unexplained(c);
    if (others < kMinCameras) return false;
    std::vector<Mask> cells(masks_.size());
    for (size_t c = 0; c < masks_.size(); ++c) {
      if (c != camera && has_unexplained(c)) {
        const ImageSize size = unexplained_[c].size();
        cells[c] = Mask({size.width / kCell + 1, size.height / kCell + 1});
      }
    }
    const SparseVolume& without = owner_.hulls_.volume(all(), camera);
    std::vector<std::pair<size_t, SeenPixel>> needing;  // cameras that need one voxel
    for_each_added(without, hull, [&](int i, int j, int k) {
      const SeenPixel here = project_voxel(owner_.lenses_[camera], i, j, k);
      if (!here.seen || !piece.get(here.x, here.y)) return;
      needing.clear();
      for (size_t c = 0; c < masks_.size(); ++c) {
        if (cells[c].size().width == 0) continue;
        const SeenPixel there = project_voxel(owner_.lenses_[c], i, j, k);
        if (there.seen && unexplained_[c].get(there.x, there.y)) needing.emplace_back(c, there);
      }
      if (std::ssize(needing) < kMinCameras) return;
      for (const auto& [c, there] : needing) cells[c].set(there.x / kCell, there.y / kCell);
    });
    return std::ranges::count_if(
               cells, [](const Mask& mask) { return mask.count() >= kMinCells; }) >= kMinCameras;
  }

  /// Repairs late cameras, the largest excess first. A late silhouette makes other cameras seem
  /// late too. False when there was none.
  bool repair_late_cameras() {
    bool found = false;
    std::vector<size_t> suspects;
    for (size_t c = 0; c < masks_.size(); ++c) {
      if (masks_[c]) suspects.push_back(c);
    }
    while (const auto late = find_late_camera(suspects)) {
      Mask repaired = in_step(late->camera, late->before, late->now);
      const Mask& given = *given_[late->camera];
      report_instead(late->camera, SilhouetteFaultKind::kPulseLate,
                     union_of(difference_of(given, repaired), difference_of(repaired, given)));
      put(late->camera, std::move(repaired));
      std::erase(suspects, late->camera);
      found = true;
    }
    return found;
  }

  struct LateCamera {
    size_t camera = 0;
    double excess = 0;
    Mask before, now;  ///< its silhouettes in the leave-one-out hulls
  };

  /// Removes suspects that are not late; returns the suspect with the largest excess. Tests the
  /// given masks, because the repair may have filled the mask of a late camera.
  std::optional<LateCamera> find_late_camera(std::vector<size_t>& suspects) {
    std::optional<LateCamera> latest;
    std::erase_if(suspects, [&](size_t c) {
      const Mask& now = expected(c);
      Mask before = owner_.hulls_.silhouette(neighbours_.before, c);
      const SilhouetteChange change = silhouette_change(*given_[c], now, before);
      if (!change.is_late()) return true;
      if (!latest || change.excess() > latest->excess) {
        latest = {c, change.excess(), std::move(before), now};
      }
      return false;
    });
    return latest;
  }

  /// The mask of a late camera for this pulse: that of its next frame when that is late too.
  /// Otherwise the union of plausible pixels, because excess foreground costs less than missing
  /// foreground.
  Mask in_step(size_t camera, const Mask& before, const Mask& now) {
    const Mask* const next = neighbours_.after.empty() ? nullptr : neighbours_.after[camera];
    Mask mask = union_of(*given_[camera], difference_of(now, before));
    if (next != nullptr) {
      const Mask after = owner_.hulls_.silhouette(neighbours_.after, camera);
      if (silhouette_change(*next, after, now).is_late()) {
        shown_later_.push_back(camera);
        return *next;
      }
      mask = union_of(std::move(mask), *next);
    }
    return intersection_of(std::move(mask), now);
  }

  void remove_phantom_pieces() {
    if (must_stop()) return;
    find_unexplained();
    for (size_t c = 0; c < masks_.size() && !must_stop(); ++c) {
      if (masks_[c] && has_unexplained(c)) remove_phantoms(c);
    }
  }

  /// True when a single other camera removes the piece from the hull: then that camera may be
  /// wrong.
  bool is_disputed(size_t camera, const Mask& piece) {
    std::vector<const Mask*> masks = all();
    for (size_t other = 0; other < masks.size() && !must_stop(); ++other) {
      if (other == camera || masks[other] == nullptr) continue;
      const Mask* const other_mask = std::exchange(masks[other], nullptr);
      const Mask expected = owner_.hulls_.silhouette(masks, camera);
      masks[other] = other_mask;
      if (2 * intersection_of(expected, piece).count() > piece.count()) return true;
    }
    return false;
  }

  /// True when other cameras see the piece too, outside the reconstructed space.
  bool stands_beside(size_t camera, const Mask& piece) {
    const Mask expected = owner_.around_.silhouette(all(), camera);
    return 2 * intersection_of(expected, piece).count() > piece.count();
  }

  void remove_phantoms(size_t camera) {
    const Mask outside = difference_of(*masks_[camera], expected(camera));
    int64_t phantom = 0;
    for (const Mask& piece : wide_pieces(outside, radius(camera))) {
      if (is_disputed(camera, piece) || stands_beside(camera, piece)) continue;
      phantom += piece.count();
      report(camera, SilhouetteFaultKind::kPhantomPiece, piece);
      put(camera, difference_of(std::move(*masks_[camera]), piece));
    }
    const auto seen = static_cast<double>(expected(camera).count());
    if (static_cast<double>(phantom) > (1 + kMostlyWrong) * seen) drop(camera, outside);
  }

  SilhouetteRepair& owner_;
  std::span<const Mask* const> given_;
  std::span<const Frame* const> frames_;
  const NeighbourMasks& neighbours_;
  const StopRequest should_stop_;
  bool stopped_ = false;
  std::vector<std::optional<Mask>> masks_;
  std::vector<Mask> expected_;  ///< of size 0 x 0 where not computed
  std::vector<size_t> shown_later_;
  std::vector<Mask> unexplained_;  ///< of size 0 x 0 where all is explained
  std::vector<SilhouetteFault> faults_;
};

double voxel_for_repair(const Box& bounds, double voxel_m) {
  return std::max(voxel_m, bounds.size().maxCoeff() / kMaxVoxels);
}

SilhouetteRepair::SilhouetteRepair(const Rig& rig, const Box& bounds, double voxel_m, int min_views)
    : rig_(rig),
      min_views_(min_views),
      hulls_(rig, bounds, voxel_m, min_views),
      around_(rig, wider(bounds), voxel_m, std::max(1, min_views - 1)) {
  for (const RigCamera& camera : rig) {
    lenses_.emplace_back(camera.model, hulls_.grid());
    const double width = pixels_per_voxel(camera.model, bounds, voxel_m);
    radii_.push_back(std::clamp(static_cast<int>(std::ceil(width)), 1, kMaxRadius));
  }
}

RepairedSilhouettes SilhouetteRepair::repair(std::span<const Mask* const> masks,
                                             std::span<const Frame* const> frames,
                                             const NeighbourMasks& neighbours) {
  return Trial(*this, masks, frames, neighbours).run();
}

std::optional<RepairedSilhouettes> SilhouetteRepair::repair_unless(
    const StopRequest& should_stop, std::span<const Mask* const> masks,
    std::span<const Frame* const> frames) {
  const NeighbourMasks no_neighbours;
  Trial trial(*this, masks, frames, no_neighbours, should_stop);
  RepairedSilhouettes repaired = trial.run();
  if (trial.is_stopped()) return std::nullopt;
  return repaired;
}

}  // namespace v3d::recon
