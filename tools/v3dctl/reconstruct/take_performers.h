// Identities of the performers of a reconstructed take.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <vector>

namespace v3d::ctl {

/// One performer in the meshes of a take.
struct PerformerPulses {
  int identity = 0;  ///< the label of his vertices, from 1
  int64_t first = 0, last = 0;
  int64_t pulses = 0;        ///< in which he has vertices
  double mean_vertices = 0;  ///< in these pulses
};

struct PerformersReport {
  int64_t frames = 0;
  int64_t undecodable = 0;  ///< frames that stay as they were: damaged, or without their reference
  double unlabelled = 0;    ///< share of all vertices that belong to no performer
  std::vector<PerformerPulses> performers;  ///< ascending by identity
};

/// Tracks the performers (recon::PerformerTracker) through the meshes of `take`, and replaces its
/// mesh.v3d by one with the same meshes that are labelled. Calls `on_frame` after each frame.
/// Throws InputError for a take without meshes, for a mesh.v3d without an index, for meshes that
/// are not surfaces of volumes of one space, and when another program writes them meanwhile;
/// std::runtime_error for errors of the disk and after an interrupt. Then the old mesh.v3d stays.
PerformersReport label_performers(const std::filesystem::path& take,
                                  const std::function<void(int64_t frames)>& on_begin,
                                  const std::function<void()>& on_frame);

}  // namespace v3d::ctl
