#include "recon/performers/performer_tracker.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <functional>
#include <utility>

#include "base/core/error.h"

namespace v3d::recon {
namespace {

constexpr int kHomeShare = 10;   ///< a home has at least this part of a performer: a tenth
constexpr int kSimilarSize = 2;  ///< largest ratio of the voxels of one object in two pulses

Eigen::Vector3i lowest_voxel(codec::BrickCoord at) {
  return codec::kBrickEdge * Eigen::Vector3i(at.x, at.y, at.z);
}

/// The lowest and the highest of the voxels along each axis. Requires at least one.
Eigen::AlignedBox3i box_of(codec::BrickCoord at, const codec::Brick& voxels) {
  Eigen::AlignedBox3i box;
  for (int z = 0; z < codec::kBrickEdge; ++z) {
    if (voxels[z] == 0) continue;
    uint64_t columns = voxels[z];
    for (int shift = 32; shift >= 8; shift /= 2) columns |= columns >> shift;
    columns &= 0xFF;
    box.extend(Eigen::Vector3i(std::countr_zero(columns), std::countr_zero(voxels[z]) / 8, z));
    box.extend(
        Eigen::Vector3i(std::bit_width(columns) - 1, (std::bit_width(voxels[z]) - 1) / 8, z));
  }
  return box.translate(lowest_voxel(at));
}

/// Mean of the voxels' centres, in voxels of the grid.
Eigen::Vector3d centre_of(const SparseVolume& volume, std::span<const ComponentPart> parts) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  int64_t voxels = 0;
  for (const ComponentPart& part : parts) {
    const Eigen::Vector3d lowest = lowest_voxel(volume.coords()[part.brick]).cast<double>();
    for (int z = 0; z < codec::kBrickEdge; ++z) {
      for (uint64_t left = part.bits[z]; left != 0; left &= left - 1, ++voxels) {
        const int bit = std::countr_zero(left);
        const int x = bit % 8, y = bit / 8;
        sum += lowest + Eigen::Vector3d(x + 0.5, y + 0.5, z + 0.5);
      }
    }
  }
  return sum / static_cast<double>(voxels);
}

/// The edge of a voxel, metres. The compact frames of one grid state it with different rounding
/// errors, which must not decide about a limit.
double rounded_voxel_m(const SparseVolume& volume) {
  constexpr double kPicometres = 1e12;
  return std::round(volume.grid().voxel_m * kPicometres) / kPicometres;
}

bool has_voxels(const PerformerVoxels& performer) {
  return !std::ranges::all_of(performer.voxels, is_empty);
}

}  // namespace

PerformerTracker::PerformerTracker(const PerformerOptions& options)
    : options_(options), contact_(options.follow_contact_motion) {}

const std::vector<PerformerVoxels>& PerformerTracker::add(int64_t pulse,
                                                          const SparseVolume& volume) {
  can_undo_ = false;
  if (volume.bricks().empty()) {
    static const std::vector<PerformerVoxels> kNone;
    return kNone;
  }
  V3D_CHECK(now_.volume.bricks().empty() ||
            (pulse > now_.pulse && now_.volume.grid() == volume.grid()));
  std::swap(now_, before_);
  try {
    track(pulse, volume);
  } catch (...) {
    std::swap(now_, before_);
    throw;
  }
  can_undo_ = true;
  return now_.performers;
}

void PerformerTracker::undo() {
  if (std::exchange(can_undo_, false)) std::swap(now_, before_);
}

/// Replaces now_ by the state of `volume`. Changes nothing in before_.
void PerformerTracker::track(int64_t pulse, const SparseVolume& volume) {
  elapsed_ = pulse - before_.pulse;
  now_.pulse = pulse;
  now_.objects.clear();
  now_.last_identity = before_.last_identity;
  components_.find(volume);
  carry(volume);
  find_homes();
  std::vector<size_t> objects;
  for (size_t c = 0; c < components_.count(); ++c) {
    std::vector<size_t> homes;
    for (size_t p = 0; p < home_.size(); ++p) {
      if (home_[p] == static_cast<int>(c)) homes.push_back(p);
    }
    if (homes.empty()) {
      objects.push_back(c);
    } else if (homes.size() == 1) {
      give(c, before_.performers[homes.front()].identity);
    } else {
      divide(volume, c, homes);
    }
  }
  for (const size_t c : objects) give(c, 0);
  std::ranges::stable_sort(objects, std::greater{},
                           [&](size_t c) { return components_.voxels(c); });
  for (const size_t c : objects) label_object(volume, c, now_.objects.emplace_back());
  std::erase_if(now_.performers, [](const auto& performer) { return !has_voxels(performer); });
  now_.volume = volume;
}

/// Gives each performer its voxels of the previous volume that are still occupied.
void PerformerTracker::carry(const SparseVolume& volume) {
  now_.performers.clear();
  for (const PerformerVoxels& before : before_.performers) {
    VoxelSet& voxels = now_.performers.emplace_back(PerformerVoxels{before.identity, {}}).voxels;
    voxels.resize(volume.bricks().size());
    for (size_t b = 0; b < voxels.size(); ++b) {
      const int index = before_.volume.index_of(volume.coords()[b]);
      if (index >= 0) voxels[b] = common(before.voxels[index], volume.bricks()[b]);
    }
  }
}

void PerformerTracker::find_homes() {
  overlap_.assign(before_.performers.size(), std::vector<int64_t>(components_.count(), 0));
  home_.assign(before_.performers.size(), -1);
  for (size_t p = 0; p < before_.performers.size(); ++p) {
    int64_t had = 0;
    for (const codec::Brick& brick : before_.performers[p].voxels) had += voxel_count(brick);
    int64_t most = std::max<int64_t>(1, had / kHomeShare) - 1;
    for (size_t c = 0; c < components_.count(); ++c) {
      int64_t& voxels = overlap_[p][c];
      for (const ComponentPart& part : components_.parts(c)) {
        voxels += voxel_count(common(now_.performers[p].voxels[part.brick], part.bits));
      }
      if (voxels <= most) continue;
      most = voxels;
      home_[p] = static_cast<int>(c);
    }
  }
}

void PerformerTracker::divide(const SparseVolume& volume, size_t component,
                              std::span<const size_t> homes) {
  const auto parts = components_.parts(component);
  PreviousPulse previous{before_.volume, {}};
  std::vector<VoxelSet*> sets;
  for (size_t p = 0; p < before_.performers.size(); ++p) {
    if (std::ranges::find(homes, p) != homes.end() && sets.size() < ContactSplit::kMaxSets) {
      previous.sets.push_back(&before_.performers[p].voxels);
      sets.push_back(&now_.performers[p].voxels);
    } else {
      for (const ComponentPart& part : parts)
        subtract(now_.performers[p].voxels[part.brick], part.bits);
    }
  }
  contact_.run(volume, parts, previous, sets);
}

/// Gives a component to a performer. `identity` 0: to none.
void PerformerTracker::give(size_t component, uint8_t identity) {
  for (PerformerVoxels& performer : now_.performers) {
    for (const ComponentPart& part : components_.parts(component)) {
      if (performer.identity == identity) {
        recon::add(performer.voxels[part.brick], part.bits);
      } else {
        subtract(performer.voxels[part.brick], part.bits);
      }
    }
  }
}

void PerformerTracker::label_object(const SparseVolume& volume, size_t component, Object& object) {
  const double voxel_m = rounded_voxel_m(volume);
  object.centre = centre_of(volume, components_.parts(component));
  object.voxels = components_.voxels(component);
  object.identity = former_performer(component);
  const double voxel_m3 = voxel_m * voxel_m * voxel_m;
  const bool is_large = static_cast<double>(object.voxels) * voxel_m3 >= options_.min_volume_m3;
  const Object* before = same_object(object, voxel_m);
  if (before != nullptr) {
    object.pulses = before->pulses + 1;
    object.velocity = (object.centre - before->centre) / static_cast<double>(elapsed_);
  }
  if (object.identity == 0 && !is_large) object.identity = owner(volume, component, before);
  const bool is_new =
      is_large && (object.identity == 0 || object.pulses > options_.pulses_to_separate);
  if (is_new && now_.last_identity < kMaxIdentity) {
    object.identity = ++now_.last_identity;
    now_.performers.push_back(
        {object.identity, VoxelSet(volume.bricks().size(), codec::kEmptyBrick)});
  }
  give(component, object.identity);
}

/// The performer who had at least half of the voxels of a component, else 0.
uint8_t PerformerTracker::former_performer(size_t component) const {
  for (size_t p = 0; p < overlap_.size(); ++p) {
    if (2 * overlap_[p][component] >= components_.voxels(component))
      return before_.performers[p].identity;
  }
  return 0;
}

/// The object of the previous volume that is nearest to its expected position; null: none is near.
const PerformerTracker::Object* PerformerTracker::same_object(const Object& object,
                                                              double voxel_m) const {
  const Object* best = nullptr;
  double least = 1;
  const auto pulses = static_cast<double>(elapsed_);
  for (const Object& before : before_.objects) {
    if (before.voxels > kSimilarSize * object.voxels ||
        object.voxels > kSimilarSize * before.voxels) {
      continue;
    }
    const double limit_m =
        before.pulses > 1 ? options_.max_object_deviation_m : options_.max_object_step_m;
    const double gap = (object.centre - before.centre - pulses * before.velocity).norm();
    const double relative = gap * voxel_m / (pulses * limit_m);
    if (relative > least) continue;
    least = relative;
    best = &before;
  }
  return best;
}

/// The performer of a component of which no performer had half. `before`: the same object in the
/// previous volume, or null. 0: none.
uint8_t PerformerTracker::owner(const SparseVolume& volume, size_t component,
                                const Object* before) const {
  const uint8_t former = before == nullptr ? 0 : before->identity;
  if (former != 0 && before->pulses > 1) return former;
  const uint8_t touching = nearest_performer(volume, component, options_.touch_distance_m);
  if (touching != 0) return touching;
  if (former != 0) return former;
  return nearest_performer(volume, component, options_.max_object_distance_m);
}

/// By the distance between the voxels' bounding boxes in each brick. 0: none is near.
uint8_t PerformerTracker::nearest_performer(const SparseVolume& volume, size_t component,
                                            double limit_m) const {
  const int limit = static_cast<int>(limit_m / rounded_voxel_m(volume));
  std::vector<Eigen::AlignedBox3i> boxes;
  Eigen::AlignedBox3i reach;
  for (const ComponentPart& part : components_.parts(component)) {
    boxes.push_back(box_of(volume.coords()[part.brick], part.bits));
    reach.extend(boxes.back());
  }
  reach.min().array() -= limit;
  reach.max().array() += limit;
  int least = limit * limit;
  uint8_t nearest = 0;
  for (const PerformerVoxels& performer : now_.performers) {
    for (size_t b = 0; b < volume.bricks().size(); ++b) {
      const codec::Brick& voxels = performer.voxels[b];
      if (is_empty(voxels)) continue;
      const Eigen::AlignedBox3i box = box_of(volume.coords()[b], voxels);
      if (!reach.intersects(box)) continue;
      for (const Eigen::AlignedBox3i& own : boxes) {
        const int gap = own.squaredExteriorDistance(box);
        if (gap >= least) continue;
        least = gap;
        nearest = performer.identity;
      }
    }
  }
  return nearest;
}

}  // namespace v3d::recon
