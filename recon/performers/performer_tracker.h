// Multi-object tracking: which performer the voxels of each visual hull belong to.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <span>
#include <vector>

#include "recon/hull/sparse_volume.h"
#include "recon/hull/volume_components.h"
#include "recon/performers/contact_split.h"
#include "recon/performers/performer_labels.h"

namespace v3d::recon {

struct PerformerOptions {
  /// Components of at least this volume can be performers, cubic metres. The hull of a person has
  /// 70 litres and more. Smaller components are objects.
  double min_volume_m3 = 0.02;
  /// A large component that separated from a performer gets an identity of its own after this
  /// number of pulses.
  int pulses_to_separate = 5;
  /// Largest distance from an object to its nearest performer, and the distance at which they
  /// almost touch, metres.
  double max_object_distance_m = 0.6, touch_distance_m = 0.05;
  /// Fastest object without and with known velocity: distance from the expected position, metres
  /// per pulse. 0.8 m at 25 pulses/s is 20 m/s.
  double max_object_step_m = 0.8, max_object_deviation_m = 0.3;
  bool follow_contact_motion = true;  ///< ContactSplit
};

/// Tracks the performers of a sequence of visual hulls by the overlap of their voxels from pulse to
/// pulse. Causal: the result for a pulse depends on this and earlier volumes alone.
///
/// - The *home* of a performer is the component with most of its voxels of the previous volume, at
///   least a tenth of them. A component that is the home of one performer belongs to it.
/// - A component that is the home of several performers is divided by ContactSplit.
/// - Another component is an *object*, such as a thrown ball or a piece of a blade. It belongs to
///   the performer who had half of its voxels; else to that of the same object in the previous
///   volume, which has a similar size and lies near the expected position; else to the nearest
///   performer within reach. A performer who almost touches it comes before an object with unknown
///   velocity.
/// - A large object without a performer is a new performer. So is one that has been apart for some
///   pulses. So performers who are in contact in the first volume are one until they separate.
///
/// Identities count from 1. A performer without a home has left, and gets a new identity if seen
/// again. Pulses may be missing; a volume without voxels changes nothing. Sizes of a voxel that
/// round to the same picometre give the same result, because a compact frame states the size
/// rounded. Keeps its working memory between pulses. One thread. Deterministic.
class PerformerTracker {
 public:
  static constexpr uint8_t kMaxIdentity = 254;  ///< further performers get no label

  explicit PerformerTracker(const PerformerOptions& options = {});

  /// The performers of the next volume, by ascending identity; each has at least one voxel. Voxels
  /// without a performer are in no set. Requires ascending pulses and volumes of the same grid.
  /// After an exception, the tracker is as before the call.
  const std::vector<PerformerVoxels>& add(int64_t pulse, const SparseVolume& volume);
  /// Takes back the last add(), whose volume turned out to be no part of the sequence. A second
  /// call changes nothing.
  void undo();

 private:
  struct Object {
    Eigen::Vector3d centre = Eigen::Vector3d::Zero();    ///< voxels
    Eigen::Vector3d velocity = Eigen::Vector3d::Zero();  ///< voxels per pulse
    int64_t voxels = 0;
    uint8_t identity = 0;
    int pulses = 1;  ///< in which it was an object
  };
  /// What the next volume is compared with.
  struct State {
    int64_t pulse = 0;
    SparseVolume volume;  ///< without voxels: none yet
    std::vector<PerformerVoxels> performers;
    std::vector<Object> objects;
    uint8_t last_identity = 0;
  };

  void track(int64_t pulse, const SparseVolume& volume);
  void carry(const SparseVolume& volume);
  void find_homes();
  void divide(const SparseVolume& volume, size_t component, std::span<const size_t> homes);
  void label_object(const SparseVolume& volume, size_t component, Object& object);
  uint8_t former_performer(size_t component) const;
  const Object* same_object(const Object& object, double voxel_m) const;
  uint8_t nearest_performer(const SparseVolume& volume, size_t component, double limit_m) const;
  uint8_t owner(const SparseVolume& volume, size_t component, const Object* before) const;
  void give(size_t component, uint8_t identity);

  const PerformerOptions options_;
  /// Of the current volume; the first performers as in before_.
  State now_;
  State before_;                               ///< of the volume before
  bool can_undo_ = false;                      ///< the last add() has changed now_
  int64_t elapsed_ = 1;                        ///< pulses between both
  std::vector<std::vector<int64_t>> overlap_;  ///< [performer][component]: carried voxels
  std::vector<int> home_;                      ///< by performer; -1: none
  VolumeComponents components_;
  ContactSplit contact_;
};

}  // namespace v3d::recon
