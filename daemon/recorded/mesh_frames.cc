#include "daemon/recorded/mesh_frames.h"

#include <algorithm>

#include "base/core/error.h"
#include "base/io/file.h"
#include "codec/frame_header.h"
#include "recon/mesh/mesh_neighbours.h"

namespace v3d::recorded {
namespace {

std::filesystem::path mesh_of(const take::TakePaths& paths, const std::filesystem::path& file) {
  load_take_info(paths);  // throws if the folder is not a take
  if (!file_exists(file)) {
    throw InputError(file.string() + ": is not there: run v3dctl reconstruct " +
                     paths.folder.string() + " first");
  }
  return file;
}

std::string text_of(take::FrameRange range) {
  std::string text = std::to_string(range.begin) + ":";
  if (range.end != take::FrameRange{}.end) text += std::to_string(range.end);
  return text;
}

}  // namespace

MeshFrames::MeshFrames(const std::filesystem::path& take)
    : MeshFrames(take, take::TakePaths{take}.mesh()) {}

MeshFrames::MeshFrames(const std::filesystem::path& take, const std::filesystem::path& file)
    : path_(mesh_of({take}, file)), file_(path_) {}

std::vector<int64_t> MeshFrames::frames(take::FrameRange range) const {
  const std::vector<int64_t>& all = file_.pulses();
  if (all.empty()) throw InputError(path_.string() + ": holds no frames");
  std::vector<int64_t> frames;
  std::copy_if(all.begin(), all.end(), std::back_inserter(frames),
               [&](int64_t frame) { return range.contains(frame); });
  if (frames.empty()) {
    throw InputError("--frames " + text_of(range) + ": " + path_.string() + " has frames " +
                     std::to_string(all.front()) + " to " + std::to_string(all.back()));
  }
  return frames;
}

recon::CompactFrame MeshFrames::read(int64_t frame) {
  frames({frame, frame + 1});
  const auto bytes = io::value_or_throw(file_.read(frame));
  const auto header = bytes ? codec::read_header(*bytes) : std::nullopt;
  if (!header) throw_damaged(frame);
  codec::DecodeStatus status = decoder_.decode(*bytes);
  if (status == codec::DecodeStatus::kNeedsReference) {
    for (const int64_t before : file_.pulses()) {
      if (before >= header->key_pulse && before < frame) decode(before);
    }
    status = decoder_.decode(*bytes);
  }
  if (status != codec::DecodeStatus::kOk) throw_damaged(frame);
  return decoder_.frame();
}

void MeshFrames::decode(int64_t frame) {
  const auto bytes = io::value_or_throw(file_.read(frame));
  if (!bytes || decoder_.decode(*bytes) != codec::DecodeStatus::kOk) throw_damaged(frame);
}

void MeshFrames::throw_damaged(int64_t frame) const {
  throw InputError(path_.string() + ": frame " + std::to_string(frame) +
                   " is damaged, or of an earlier version: reconstruct the take again");
}

recon::TextureOptions texture_options(const Mesh& mesh) {
  const double edge = recon::mean_edge(mesh);
  recon::TextureOptions options;
  options.depth_tolerance_m = 3 * edge;
  options.occluder_radius_m = 0.71 * edge;
  options.demosaic = true;
  options.by_resolution = true;
  return options;
}

std::vector<recon::TextureCamera> texture_cameras(const Rig& rig, const recon::FrameSet& set) {
  std::vector<recon::TextureCamera> cameras;
  for (const Frame& frame : set.frames) {
    const auto index = static_cast<size_t>(find_camera(rig, frame.camera));
    cameras.push_back({&rig[index].model, &frame, &rig[index].colour});
  }
  return cameras;
}

FrameColours::FrameColours(const std::filesystem::path& take, const recon::CompactFrame& frame) {
  TakeFrames frames(take, frame.cameras);
  rig_ = frames.rig();
  set_ = observe_all(frame.pulse, frames.read(frame.pulse));
  if (set_.frames.size() == frame.cameras.size()) return;
  throw InputError(frames.paths().folder.string() + ": pulse " + std::to_string(frame.pulse) +
                   ": frames of " + std::to_string(set_.frames.size()) + " of its " +
                   std::to_string(frame.cameras.size()) +
                   " cameras can be read; see v3dctl verify");
}

Mesh FrameColours::coloured(Mesh mesh) const { return coloured(std::move(mesh), std::nullopt); }

Mesh FrameColours::coloured_for(const CameraModel& eye, Mesh mesh) const {
  return coloured(std::move(mesh), recon::ViewDependence{eye.viewing_direction()});
}

Mesh FrameColours::coloured(Mesh mesh, std::optional<recon::ViewDependence> view) const {
  if (mesh.vertices.empty()) return mesh;
  recon::TextureOptions options = texture_options(mesh);
  options.view = view;
  mesh.colours = colour_vertices(mesh, texture_cameras(rig_, set_), options).colours;
  return mesh;
}

}  // namespace v3d::recorded
