#include "recon/silhouette_mender.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <utility>

#include "base/mask_pieces.h"
#include "base/mask_shape.h"
#include "recon/joint_denial.h"
#include "recon/late_silhouette.h"
#include "recon/solid_look.h"

namespace v3d {
namespace {

/// Foreground that nothing explains counts in cells of so many pixels along each side.
constexpr int kCell = 4;
/// So many cells of so many other cameras must need a piece; those of one camera alone, or of
/// several at different places, may be explained by what no voxel is small enough to show.
constexpr int64_t kLeastCells = 4;
constexpr int kLeastCameras = 2;
/// A fault covers at least so many squares as wide as twice the camera's radius.
constexpr int kLeastSquares = 2;
/// A camera of whose expected silhouette so much is missing, or that shows so much more, is left
/// out.
constexpr double kMostlyWrong = 0.5;
/// Cameras are mended one after the other, no more often than this.
constexpr int kRounds = 8;
/// And so often what several of them have lost together.
constexpr int kJointRounds = 3;

/// Voxels' width in pixels where the middle of the space is.
double pixels_per_voxel(const CameraModel& camera, const Box& bounds, double voxel_m) {
  const Eigen::Vector3d middle = 0.5 * (bounds.min + bounds.max);
  const double distance = (camera.center() - middle).norm();
  return camera.matrix()(0, 0) * voxel_m / std::max(distance, voxel_m);
}

/// By a quarter of its size on every side.
Box wider(const Box& box) {
  const Eigen::Vector3d margin = 0.25 * box.size();
  return {box.min - margin, box.max + margin};
}

/// Voxels of `a` that `b` has not, of the same grid: calls visit(i, j, k).
template <class Visit>
void for_each_more(const SparseVolume& a, const SparseVolume& b, Visit&& visit) {
  for (size_t n = 0; n < a.bricks().size(); ++n) {
    const BrickCoord at = a.coords()[n];
    const int other = b.index_of(at);
    for (int z = 0; z < kBrickEdge; ++z) {
      uint64_t more = a.bricks()[n][z] & ~(other >= 0 ? b.bricks()[other][z] : 0);
      for (; more != 0; more &= more - 1) {
        const int bit = std::countr_zero(more);
        visit(kBrickEdge * at.x + bit % kBrickEdge, kBrickEdge * at.y + bit / kBrickEdge,
              kBrickEdge * at.z + z);
      }
    }
  }
}

/// Background that foreground surrounds, of at least `least` pixels.
bool has_hole(const Mask& mask, int64_t least) {
  const Rect box = mask.bounding_box();
  Mask background(mask.size());
  for (int y = box.y0; y < box.y0 + box.height; ++y) {
    background.fill_row(y, box.x0, box.x0 + box.width);
  }
  background = only_first(std::move(background), mask);
  MaskPieces pieces;
  pieces.find(background);
  for (size_t p = 0; p < pieces.count(); ++p) {
    if (pieces.area(p) < least) continue;
    bool enclosed = true;
    pieces.for_each_run(p, [&](const Run& run) {
      enclosed = run.y > box.y0 && run.y < box.y0 + box.height - 1 && run.begin > box.x0 &&
                 run.end < box.x0 + box.width;
      return enclosed;
    });
    if (enclosed) return true;
  }
  return false;
}

Mask mask_of(const MaskPieces& pieces, size_t piece, ImageSize size) {
  Mask mask(size);
  pieces.for_each_run(piece, [&](const Run& run) {
    mask.fill_row(run.y, run.begin, run.end);
    return true;
  });
  return mask;
}

}  // namespace

/// The silhouettes of one pulse while they are mended.
class SilhouetteMender::Trial {
 public:
  Trial(SilhouetteMender& mender, std::span<const Mask* const> masks,
        std::span<const Frame* const> frames, const NeighbourMasks& neighbours)
      : mender_(mender), given_(masks), frames_(frames), neighbours_(neighbours) {
    for (const Mask* mask : masks) masks_.push_back(mask ? std::optional(*mask) : std::nullopt);
  }

  MendedSilhouettes run() {
    drop_blind_cameras();
    fill_missing_pieces();
    for (int round = 0; round < kJointRounds && fill_jointly_missing_pieces(); ++round) {
      fill_missing_pieces();
    }
    std::optional<Trial> alone;
    if (!neighbours_.before.empty()) {
      alone.emplace(*this);
      // Where no camera is late, nothing was changed.
      if (!mend_late_cameras()) alone.reset();
    }
    remove_phantom_pieces();
    if (alone) alone->remove_phantom_pieces();
    std::ranges::stable_sort(faults_, {}, &SilhouetteFault::camera);
    std::vector<std::optional<Mask>> masks_alone = alone ? std::move(alone->masks_) : masks_;
    return {std::move(masks_), std::move(masks_alone), std::move(shown_later_), std::move(faults_)};
  }

 private:
  std::vector<const Mask*> all() const {
    std::vector<const Mask*> masks;
    for (const auto& mask : masks_) masks.push_back(mask ? &*mask : nullptr);
    return masks;
  }
  int radius(size_t camera) const { return mender_.radii_[camera]; }
  int64_t least_pixels(size_t camera) const {
    const int64_t edge = 2 * radius(camera) + 1;
    return kLeastSquares * edge * edge;
  }

  void report(size_t camera, SilhouetteFaultKind kind, const Mask& where) {
    faults_.push_back({camera, kind, where.bounding_box(), where.count()});
  }

  /// The only fault of this camera.
  void report_instead(size_t camera, SilhouetteFaultKind kind, const Mask& where) {
    std::erase_if(faults_, [&](const SilhouetteFault& fault) { return fault.camera == camera; });
    report(camera, kind, where);
  }

  void drop(size_t camera, const Mask& where) {
    report_instead(camera, SilhouetteFaultKind::kWholeCamera, where);
    masks_[camera].reset();
  }

  /// One black image leaves nothing of the volume, and two of them hide each other.
  void drop_blind_cameras() {
    std::vector<size_t> blind;
    for (size_t c = 0; c < masks_.size(); ++c) {
      if (masks_[c] && masks_[c]->count() == 0) blind.push_back(c);
    }
    if (blind.empty() || 2 * blind.size() > masks_.size()) return;
    std::vector<const Mask*> others = all();
    for (const size_t c : blind) others[c] = nullptr;
    const std::vector<Mask> expected = mender_.hulls_.silhouettes(others);
    for (const size_t c : blind) {
      if (expected[c].count() >= least_pixels(c)) drop(c, expected[c]);
    }
  }

  /// Foreground of each camera outside the silhouette of the volume, without what is narrow.
  void find_unexplained() {
    const auto masks = all();
    const std::vector<Mask> explained = mender_.hulls_.silhouettes(masks);
    unexplained_.assign(masks_.size(), Mask());
    for (size_t c = 0; c < masks_.size(); ++c) {
      if (!masks_[c]) continue;
      Mask rest = opened(only_first(*masks_[c], explained[c]), radius(c));
      if (rest.count() >= kLeastCells * kCell * kCell) unexplained_[c] = std::move(rest);
    }
  }
  bool has_unexplained(size_t camera) const { return unexplained_[camera].size().width > 0; }

  bool is_in_doubt(size_t camera) const {
    for (size_t c = 0; c < masks_.size(); ++c) {
      if (c != camera && has_unexplained(c)) return true;
    }
    return has_hole(*masks_[camera], least_pixels(camera));
  }

  /// The pieces of one camera that are missing.
  struct MissingPieces {
    size_t camera = 0;
    int64_t pixels = 0;
    std::vector<Mask> pieces;
    Mask expected;
  };

  void fill_missing_pieces() {
    for (int round = 0; round < kRounds && fill_most_missing_pieces(); ++round) continue;
  }

  /// Fills what the camera lacks that lacks most: in the hulls that it spoils, others seem to lack
  /// pieces too. False when there was nothing to fill.
  bool fill_most_missing_pieces() {
    find_unexplained();
    const SparseVolume hull = mender_.hulls_.volume(all());
    MissingPieces most;
    for (size_t c = 0; c < masks_.size(); ++c) {
      if (!masks_[c] || !is_in_doubt(c)) continue;
      MissingPieces missing = missing_pieces(c, hull);
      if (missing.pixels > most.pixels) most = std::move(missing);
    }
    for (const Mask& piece : most.pieces) {
      report(most.camera, SilhouetteFaultKind::kMissingPiece, piece);
      masks_[most.camera] = either(std::move(*masks_[most.camera]), piece);
    }
    if (static_cast<double>(most.pixels) >
        kMostlyWrong * static_cast<double>(most.expected.count())) {
      drop(most.camera, most.expected);
    }
    return most.pixels > 0;
  }

  /// What several cameras have lost together. False when there was nothing to fill.
  bool fill_jointly_missing_pieces() {
    find_unexplained();
    const JointDenialOptions options{.min_views = mender_.min_views_};
    int asking = 0;
    for (size_t c = 0; c < masks_.size(); ++c) asking += has_unexplained(c);
    if (asking < options.least_asking) return false;
    const std::vector<Mask> denied =
        jointly_denied(mender_.hulls_.grid(), mender_.lenses_, all(), unexplained_, options);
    bool filled = false;
    for (size_t c = 0; c < masks_.size(); ++c) {
      if (denied[c].size().width > 0) filled |= fill_wide_pieces(c, denied[c]);
    }
    return filled;
  }

  bool fill_wide_pieces(size_t camera, const Mask& denied) {
    const Mask lost = only_first(grown(denied, radius(camera)), *masks_[camera]);
    MaskPieces pieces;
    pieces.find(opened(lost, radius(camera)));
    bool filled = false;
    for (size_t p = 0; p < pieces.count(); ++p) {
      if (pieces.area(p) < least_pixels(camera)) continue;
      const Mask piece = both(grown(mask_of(pieces, p, lost.size()), radius(camera)), lost);
      report(camera, SilhouetteFaultKind::kMissingPiece, piece);
      masks_[camera] = either(std::move(*masks_[camera]), piece);
      filled = true;
    }
    return filled;
  }

  MissingPieces missing_pieces(size_t camera, const SparseVolume& hull) {
    MissingPieces missing{
        .camera = camera, .pieces = {}, .expected = mender_.hulls_.silhouette(all(), camera)};
    const Mask inside = only_first(missing.expected, *masks_[camera]);
    MaskPieces pieces;
    pieces.find(opened(inside, radius(camera)));
    for (size_t p = 0; p < pieces.count(); ++p) {
      if (pieces.area(p) < least_pixels(camera)) continue;
      Mask piece = both(grown(mask_of(pieces, p, inside.size()), radius(camera)), inside);
      if (!is_needed(camera, piece, hull) && !looks_solid(camera, piece)) continue;
      missing.pixels += piece.count();
      missing.pieces.push_back(std::move(piece));
    }
    return missing;
  }

  /// Whether voxels that only this camera refutes, there, would explain foreground of others.
  bool is_needed(size_t camera, const Mask& piece, const SparseVolume& hull) {
    std::vector<Mask> cells(masks_.size());
    for (size_t c = 0; c < masks_.size(); ++c) {
      if (c != camera && has_unexplained(c)) {
        const ImageSize size = unexplained_[c].size();
        cells[c] = Mask({size.width / kCell + 1, size.height / kCell + 1});
      }
    }
    const SparseVolume& without = mender_.hulls_.volume(all(), camera);
    std::vector<std::pair<size_t, SeenPixel>> asking;  // of one voxel
    for_each_more(without, hull, [&](int i, int j, int k) {
      const SeenPixel here = project_voxel(mender_.lenses_[camera], i, j, k);
      if (!here.seen || !piece.get(here.x, here.y)) return;
      asking.clear();
      for (size_t c = 0; c < masks_.size(); ++c) {
        if (cells[c].size().width == 0) continue;
        const SeenPixel there = project_voxel(mender_.lenses_[c], i, j, k);
        if (there.seen && unexplained_[c].get(there.x, there.y)) asking.emplace_back(c, there);
      }
      if (std::ssize(asking) < kLeastCameras) return;
      for (const auto& [c, there] : asking) cells[c].set(there.x / kCell, there.y / kCell);
    });
    return std::ranges::count_if(cells, [](const Mask& mask) {
             return mask.count() >= kLeastCells;
           }) >= kLeastCameras;
  }

  bool looks_solid(size_t camera, const Mask& piece) {
    const auto masks = all();
    return v3d::looks_solid(mender_.rig_, frames_, camera, piece,
                            mender_.hulls_.surface(masks, camera), mender_.hulls_.grid().voxel_m);
  }

  /// The one that is late most plainly first: in the hulls that it spoils, others seem so too.
  /// False when there was none.
  bool mend_late_cameras() {
    bool found = false;
    std::vector<size_t> suspects;
    for (size_t c = 0; c < masks_.size(); ++c) {
      if (masks_[c]) suspects.push_back(c);
    }
    while (const auto late = latest_of(suspects)) {
      Mask mended = in_step(late->camera, late->before, late->now);
      const Mask& given = *given_[late->camera];
      report_instead(late->camera, SilhouetteFaultKind::kPulseLate,
                     either(only_first(given, mended), only_first(mended, given)));
      masks_[late->camera] = std::move(mended);
      std::erase(suspects, late->camera);
      found = true;
    }
    return found;
  }

  struct LateCamera {
    size_t camera = 0;
    double excess = 0;
    Mask before, now;  ///< what the others say of it
  };

  /// Keeps of the suspects those that are late. Judged are the masks as they were given: a late one
  /// may have been filled where it lacks what has come.
  std::optional<LateCamera> latest_of(std::vector<size_t>& suspects) {
    std::optional<LateCamera> latest;
    std::erase_if(suspects, [&](size_t c) {
      Mask now = mender_.hulls_.silhouette(all(), c);
      Mask before = mender_.hulls_.silhouette(neighbours_.before, c);
      const ShownChange change = change_shown(*given_[c], now, before);
      if (!change.is_late()) return true;
      if (!latest || change.excess() > latest->excess) {
        latest = {c, change.excess(), std::move(before), std::move(now)};
      }
      return false;
    });
    return latest;
  }

  /// The silhouette that a late camera should have: the next one, where that is late too; else
  /// whatever lies between the two, for what is too much costs less than what is missing.
  Mask in_step(size_t camera, const Mask& before, const Mask& now) {
    const Mask* const next = neighbours_.after.empty() ? nullptr : neighbours_.after[camera];
    Mask mask = either(*given_[camera], only_first(now, before));
    if (next != nullptr) {
      const Mask after = mender_.hulls_.silhouette(neighbours_.after, camera);
      if (change_shown(*next, after, now).is_late()) {
        shown_later_.push_back(camera);
        return *next;
      }
      mask = either(std::move(mask), *next);
    }
    return both(std::move(mask), now);
  }

  void remove_phantom_pieces() {
    find_unexplained();
    for (size_t c = 0; c < masks_.size(); ++c) {
      if (masks_[c] && has_unexplained(c)) look_for_phantoms(c);
    }
  }

  /// Where one other camera alone denies a piece, that one may be the one that is wrong.
  bool is_disputed(size_t camera, const Mask& piece) {
    std::vector<const Mask*> masks = all();
    for (size_t other = 0; other < masks.size(); ++other) {
      if (other == camera || masks[other] == nullptr) continue;
      const Mask* const denies = std::exchange(masks[other], nullptr);
      const Mask expected = mender_.hulls_.silhouette(masks, camera);
      masks[other] = denies;
      if (2 * both(expected, piece).count() > piece.count()) return true;
    }
    return false;
  }

  /// Whether the others see it too, but where nothing is reconstructed.
  bool stands_beside(size_t camera, const Mask& piece) {
    const Mask expected = grown(mender_.around_.silhouette(all(), camera), radius(camera));
    return 2 * both(expected, piece).count() > piece.count();
  }

  void look_for_phantoms(size_t camera) {
    const Mask expected = mender_.hulls_.silhouette(all(), camera);
    const Mask outside = only_first(*masks_[camera], expected);
    MaskPieces pieces;
    pieces.find(opened(outside, radius(camera)));
    int64_t phantom = 0;
    for (size_t p = 0; p < pieces.count(); ++p) {
      if (pieces.area(p) < least_pixels(camera)) continue;
      const Mask piece = both(grown(mask_of(pieces, p, expected.size()), radius(camera)), outside);
      if (is_disputed(camera, piece) || stands_beside(camera, piece)) continue;
      phantom += piece.count();
      report(camera, SilhouetteFaultKind::kPhantomPiece, piece);
      masks_[camera] = only_first(std::move(*masks_[camera]), piece);
    }
    if (static_cast<double>(phantom) > (1 + kMostlyWrong) * static_cast<double>(expected.count())) {
      drop(camera, outside);
    }
  }

  SilhouetteMender& mender_;
  std::span<const Mask* const> given_;
  std::span<const Frame* const> frames_;
  const NeighbourMasks& neighbours_;
  std::vector<std::optional<Mask>> masks_;
  std::vector<size_t> shown_later_;
  std::vector<Mask> unexplained_;  ///< of size 0 x 0 where all is explained
  std::vector<SilhouetteFault> faults_;
};

SilhouetteMender::SilhouetteMender(const Rig& rig, const Box& bounds, double voxel_m, int min_views)
    : rig_(rig),
      min_views_(min_views),
      hulls_(rig, bounds, voxel_m, min_views),
      around_(rig, wider(bounds), voxel_m, std::max(1, min_views - 1)) {
  for (const RigCamera& camera : rig) {
    lenses_.emplace_back(camera.model, hulls_.grid());
    const double width = pixels_per_voxel(camera.model, bounds, voxel_m);
    radii_.push_back(std::clamp(static_cast<int>(std::ceil(width)), 1, kMostRadius));
  }
}

MendedSilhouettes SilhouetteMender::mend(std::span<const Mask* const> masks,
                                         std::span<const Frame* const> frames,
                                         const NeighbourMasks& neighbours) {
  return Trial(*this, masks, frames, neighbours).run();
}

}  // namespace v3d
