#include "v3dctl/reconstruct/take_revision.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>
#include <vector>

#include "base/core/error.h"
#include "base/io/process.h"
#include "codec/frame_reviser.h"
#include "common/console.h"
#include "daemon/recorded/mesh_frames.h"
#include "daemon/recorded/take_frames.h"
#include "recon/performers/performer_labeller.h"
#include "recon/performers/performer_labels.h"
#include "recon/performers/performer_tracker.h"
#include "recon/pipeline/compact_frame.h"
#include "recon/pipeline/frame_volume.h"
#include "recon/texture/texture.h"
#include "take/logs/mesh_file.h"
#include "take/take.h"
#include "v3dctl/reconstruct/pending_mesh_file.h"

namespace v3d::ctl {
namespace {

class CameraColourist {
 public:
  CameraColourist(const std::filesystem::path& take, size_t max_bytes) : max_bytes_(max_bytes) {
    if (max_bytes_ > 0) frames_.emplace(take, std::vector<std::string>());
  }

  /// The frame with the colours of its cameras; unchanged when it cannot be decoded.
  std::vector<uint8_t> revise(const std::vector<uint8_t>& compact) {
    ++report_.frames;
    if (codec_.decode(compact) != codec::DecodeStatus::kOk) {
      ++report_.undecodable;
      return compact;
    }
    std::vector<uint8_t> revised = codec_.with_cameras(views(), max_bytes_);
    const auto [bytes, step] = codec_.camera_cost();
    if (bytes > 0) ++coloured_;
    // A pulse without a surface has nothing to colour.
    if (bytes == 0 && !codec_.frame().positions.empty()) ++report_.without;
    report_.mean_bytes += static_cast<double>(bytes);
    report_.mean_step += step;
    report_.mean_frame_bytes += static_cast<double>(revised.size());
    return revised;
  }

  /// A frame that cannot be read.
  void count_damaged() {
    ++report_.frames;
    ++report_.undecodable;
  }

  CameraColourReport report() const {
    CameraColourReport report = report_;
    const auto decoded =
        static_cast<double>(std::max<int64_t>(1, report.frames - report.undecodable));
    const auto coloured = static_cast<double>(std::max<int64_t>(1, coloured_));
    report.mean_bytes /= decoded;
    report.mean_frame_bytes /= decoded;
    report.mean_step /= coloured;
    return report;
  }

 private:
  /// Empty when the raw frame of a camera cannot be read.
  std::vector<codec::CameraView> views() {
    const codec::DecodedFrame& decoded = codec_.frame();
    if (!frames_ || decoded.colours.empty()) return {};
    const codec::FrameMetadata& metadata = decoded.metadata;
    const recon::FrameSet set = observe_all(
        metadata.pulse,
        recorded::read_used({metadata.pulse, metadata.cameras, metadata.late_cameras}, *frames_));
    if (set.frames.size() != metadata.cameras.size()) return {};
    const Mesh mesh = recon::mesh_of(decoded);
    return recon::camera_views(camera_colours(mesh, recorded::texture_cameras(frames_->rig(), set),
                                              recorded::texture_options(mesh)),
                               frames_->rig());
  }

  const size_t max_bytes_;
  std::optional<recorded::TakeFrames> frames_;
  codec::FrameReviser codec_;
  CameraColourReport report_;
  int64_t coloured_ = 0;  ///< frames with colours of cameras
};

}  // namespace

CameraColourReport add_camera_colours(const std::filesystem::path& take, size_t max_bytes,
                                      const std::function<void(int64_t frames)>& on_begin,
                                      const FrameCallback& on_frame) {
  const std::filesystem::path path = take::TakePaths{take}.mesh();
  if (!std::filesystem::exists(path)) {
    throw InputError(path.string() + ": is not there: run v3dctl reconstruct " + take.string());
  }
  const FileVersion source(path);
  take::MeshFileReader meshes(path);
  require_finished(meshes, path);
  on_begin(std::ssize(meshes.pulses()));
  CameraColourist colourist(take, max_bytes);
  PendingMeshFile file(path);
  for (const int64_t pulse : meshes.pulses()) {
    stop_if_interrupted();
    const take::MeshRecord mesh = io::value_or_throw(meshes.read_record(pulse));
    if (mesh.is_intact()) {
      file.append(pulse, colourist.revise(mesh.compact));
    } else {
      colourist.count_damaged();
      file.append(pulse, mesh);
    }
    on_frame();
  }
  file.finish(source);
  return colourist.report();
}

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
