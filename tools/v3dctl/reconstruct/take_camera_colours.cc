#include "v3dctl/reconstruct/take_camera_colours.h"

#include <algorithm>
#include <optional>
#include <vector>

#include "base/core/error.h"
#include "codec/frame_reviser.h"
#include "common/console.h"
#include "daemon/recorded/mesh_frames.h"
#include "daemon/recorded/take_frames.h"
#include "recon/pipeline/compact_frame.h"
#include "recon/texture/view_colours.h"
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

}  // namespace v3d::ctl
