// The performer of every vertex, for the meshes of a sequence of pulses. Live and offline.
#pragma once

#include <cstdint>
#include <vector>

#include "recon/performers/performer_labels.h"
#include "recon/performers/performer_tracker.h"

namespace v3d::recon {

/// Tracks the performers of a sequence of volumes and labels the vertices of their surfaces. The
/// labels depend on this sequence alone. So live meshes get the labels that their recorded compact
/// frames get. One caller at a time; works in the caller's TBB arena. Deterministic.
class PerformerLabeller {
 public:
  /// The label of each vertex of MarchingCubes::run(volume), see VertexLabels::find(). Requires
  /// ascending pulses and volumes of the same grid. After an exception, the labeller is as before
  /// the call.
  std::vector<uint8_t> label(int64_t pulse, const SparseVolume& volume) {
    const std::vector<PerformerVoxels>& performers = tracker_.add(pulse, volume);
    try {
      std::vector<uint8_t> labels = vertices_.find(volume, performers);
      count_ = performers.size();
      return labels;
    } catch (...) {
      tracker_.undo();
      throw;
    }
  }
  /// Takes back the last label(): the pulse has no mesh.
  void undo() { tracker_.undo(); }

  /// The number of performers in the last volume that label() got.
  size_t count() const { return count_; }

 private:
  PerformerTracker tracker_;
  VertexLabels vertices_;
  size_t count_ = 0;
};

}  // namespace v3d::recon
