#include "v3dctl/reconstruct/take_performers.h"

#include <array>
#include <cmath>
#include <map>
#include <optional>

#include "base/core/error.h"
#include "base/io/process.h"
#include "codec/frame_reviser.h"
#include "common/console.h"
#include "recon/performers/performer_labeller.h"
#include "recon/pipeline/frame_volume.h"
#include "take/logs/mesh_file.h"
#include "take/take.h"
#include "v3dctl/reconstruct/pending_mesh_file.h"

namespace v3d::ctl {
namespace {

/// Empty for a damaged frame.
using FrameBytes = std::optional<std::vector<uint8_t>>;

/// Voxels that differ by less are the same; frames round differently.
constexpr double kSameVoxelM = 1e-9;

/// The grid of all volumes of the file.
recon::VoxelGrid common_grid(take::MeshFileReader& meshes, const std::filesystem::path& path) {
  std::optional<recon::VoxelGrid> all;
  for (const int64_t pulse : meshes.pulses()) {
    const FrameBytes compact = io::value_or_throw(meshes.read(pulse));
    const auto grid = compact ? recon::frame_grid(*compact) : std::nullopt;
    if (!grid) continue;
    if (!all) all = grid;
    if (all->origin != grid->origin || std::abs(all->voxel_m - grid->voxel_m) > kSameVoxelM) {
      throw InputError(path.string() + ": pulse " + std::to_string(pulse) +
                       " has another space or voxel than the pulses before it; expected meshes of "
                       "one v3dctl reconstruct");
    }
    for (size_t axis = 0; axis < 3; ++axis) {
      all->counts[axis] = std::max(all->counts[axis], grid->counts[axis]);
    }
  }
  if (!all) {
    throw InputError(path.string() +
                     ": has no mesh of a volume; expected meshes of v3dctl reconstruct");
  }
  try {
    require_memory(*all, static_cast<double>(available_memory()));
  } catch (const InputError& error) {
    throw InputError(path.string() + ": its meshes claim too large a space: " + error.what());
  }
  return *all;
}

class Labeller {
 public:
  explicit Labeller(const recon::VoxelGrid& grid) : grid_(grid) {}

  /// The frame with labels; unchanged when it cannot be decoded.
  std::vector<uint8_t> label(int64_t pulse, const std::vector<uint8_t>& compact) {
    ++report_.frames;
    const auto volume = codec_.decode(compact) == codec::DecodeStatus::kOk
                            ? recon::frame_volume(compact, grid_)
                            : std::nullopt;
    if (!volume) {
      ++report_.undecodable;
      return compact;
    }
    const std::vector<uint8_t> labels = labeller_.label(pulse, *volume);
    count(pulse, labels);
    return codec_.labelled(labels);
  }

  /// A frame that cannot be read.
  void count_damaged() {
    ++report_.frames;
    ++report_.undecodable;
  }

  PerformersReport report() {
    for (auto& [identity, performer] : performers_) {
      performer.mean_vertices /= static_cast<double>(performer.pulses);
      report_.performers.push_back(performer);
    }
    report_.unlabelled = vertices_total_ > 0 ? unlabelled_ / vertices_total_ : 0;
    return report_;
  }

 private:
  void count(int64_t pulse, const std::vector<uint8_t>& labels) {
    std::array<int64_t, 256> counts{};
    for (const uint8_t label : labels) ++counts[label];
    unlabelled_ += static_cast<double>(counts[0]);
    vertices_total_ += static_cast<double>(labels.size());
    for (int identity = 1; identity < 256; ++identity) {
      const int64_t vertices = counts[static_cast<size_t>(identity)];
      if (vertices == 0) continue;
      PerformerPulses& performer =
          performers_.try_emplace(identity, PerformerPulses{.identity = identity, .first = pulse})
              .first->second;
      performer.last = pulse;
      ++performer.pulses;
      performer.mean_vertices += static_cast<double>(vertices);
    }
  }

  const recon::VoxelGrid grid_;
  codec::FrameReviser codec_;
  recon::PerformerLabeller labeller_;
  std::map<int, PerformerPulses> performers_;
  double unlabelled_ = 0, vertices_total_ = 0;
  PerformersReport report_;
};

}  // namespace

PerformersReport label_performers(const std::filesystem::path& take,
                                  const std::function<void(int64_t frames)>& on_begin,
                                  const std::function<void()>& on_frame) {
  const std::filesystem::path path = take::TakePaths{take}.mesh();
  if (!std::filesystem::exists(path)) {
    throw InputError(path.string() + ": is not there: run v3dctl reconstruct " + take.string());
  }
  const FileVersion source(path);
  take::MeshFileReader meshes(path);
  require_finished(meshes, path);
  on_begin(std::ssize(meshes.pulses()));
  Labeller labeller(common_grid(meshes, path));
  PendingMeshFile file(path);
  for (const int64_t pulse : meshes.pulses()) {
    stop_if_interrupted();
    const take::MeshRecord mesh = io::value_or_throw(meshes.read_record(pulse));
    if (mesh.is_intact()) {
      file.append(pulse, labeller.label(pulse, mesh.compact));
    } else {
      labeller.count_damaged();
      file.append(pulse, mesh);
    }
    on_frame();
  }
  file.finish(source);
  return labeller.report();
}

}  // namespace v3d::ctl
