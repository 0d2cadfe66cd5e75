#include "v3dctl/motion/pulse_source.h"

#include <algorithm>
#include <span>
#include <utility>

#include "base/core/error.h"
#include "common/mesh_formats.h"
#include "common/natural_order.h"
#include "daemon/recorded/mesh_frames.h"
#include "daemon/recorded/take_frames.h"
#include "recon/mesh/mesh_neighbours.h"
#include "recon/render/renderer.h"
#include "v3dctl/reconstruct/reconstruct_request.h"

namespace v3d::ctl {
namespace {

namespace fs = std::filesystem;

/// A pulse needs about 40 MB. The tracking reads those of a segment twice.
constexpr size_t kKeptPulses = 32;

/// A frame whose silhouette is the whole image. It has pixels only because a camera without pixels
/// counts as absent.
Frame blank_frame(const RigCamera& camera) {
  Frame frame;
  frame.camera = camera.name;
  frame.sensor_size = camera.model.size();
  frame.mask.emplace(frame.sensor_size);
  for (int y = 0; y < frame.sensor_size.height; ++y) {
    frame.mask->fill_row(y, 0, frame.sensor_size.width);
  }
  frame.roi = {0, 0, 2, 2};
  frame.image = Image({2, 2}, PixelFormat::kMono8);
  return frame;
}

class TakePulses : public ObservedPulses {
 public:
  TakePulses(const fs::path& take, take::FrameRange frames)
      : meshes_(take), images_(take, {}), pulses_(meshes_.frames(frames)) {
    for (const RigCamera& camera : images_.rig()) blank_frames_.push_back(blank_frame(camera));
  }

  const std::vector<int64_t>& pulses() const override { return pulses_; }

  recon::Texture colours(size_t index, const Mesh& surface) override {
    const auto pulse = read(index);
    const auto cameras = recorded::texture_cameras(images_.rig(), pulse->frames);
    if (cameras.empty()) return {};
    return recon::colour_vertices(surface, cameras, recorded::texture_options(surface));
  }

  std::shared_ptr<const recon::ObservedPulse> read_surface(size_t index) override {
    auto pulse = std::make_shared<recon::ObservedPulse>();
    const recorded::UsedCameras used = read_mesh_frame(index, *pulse);
    const Rig& rig = images_.rig();
    std::vector<recon::DeformCamera> cameras;
    for (size_t c = 0; c < rig.size(); ++c) {
      if (!std::ranges::binary_search(used.names, rig[c].name)) continue;
      cameras.push_back({&rig[c].model, &blank_frames_[c]});
    }
    set_cameras(cameras, *pulse);
    return pulse;
  }

  bool is_unfinished() const override { return meshes_.is_unfinished(); }
  std::vector<std::string> read_errors() const override { return images_.read_errors(); }

 protected:
  std::shared_ptr<recon::ObservedPulse> load(size_t index) override {
    auto pulse = std::make_shared<recon::ObservedPulse>();
    const recorded::UsedCameras used = read_mesh_frame(index, *pulse);
    // The reconstruction leaves out displaced cameras and wrong silhouettes.
    pulse->frames = recorded::observe_all(pulse->pulse, recorded::read_used(used, images_));
    std::vector<recon::DeformCamera> cameras;
    const recon::RigFrames usable = recon::usable_frames(images_.rig(), pulse->frames);
    for (size_t c = 0; c < usable.size(); ++c) {
      if (usable[c]) cameras.push_back({&images_.rig()[c].model, usable[c]});
    }
    set_cameras(cameras, *pulse);
    return pulse;
  }

 private:
  /// Sets the number and the surface of a pulse. Returns the cameras that made the surface.
  recorded::UsedCameras read_mesh_frame(size_t index, recon::ObservedPulse& pulse) {
    pulse.pulse = pulses_[index];
    recon::CompactFrame frame = meshes_.read(pulse.pulse);
    pulse.surface = std::move(frame.mesh);
    return recorded::used_cameras(frame);
  }

  static void set_cameras(std::span<const recon::DeformCamera> cameras,
                          recon::ObservedPulse& pulse) {
    pulse.cameras = recon::SurfaceCameras(cameras, pulse.surface, recon::mean_edge(pulse.surface));
  }

  recorded::MeshFrames meshes_;
  recorded::TakeFrames images_;
  std::vector<Frame> blank_frames_;  ///< of each camera of the rig
  const std::vector<int64_t> pulses_;
};

Mesh read_mesh(const fs::path& file) {
  return file.extension() == ".obj" ? read_obj(file) : read_ply(file);
}

/// The first one with a surface; an empty mesh where none has one.
Mesh first_mesh(const std::vector<fs::path>& files) {
  for (const fs::path& file : files) {
    Mesh mesh = read_mesh(file);
    if (!mesh.vertices.empty()) return mesh;
  }
  return {};
}

class FolderMeshes : public ObservedPulses {
 public:
  FolderMeshes(const fs::path& folder, double height_m, take::FrameRange frames) {
    const std::vector<fs::path> files = mesh_files(folder);
    for (size_t i = 0; i < files.size(); ++i) {
      const auto pulse = static_cast<int64_t>(i);
      if (!frames.contains(pulse)) continue;
      files_.push_back(files[i]);
      pulses_.push_back(pulse);
    }
    if (files_.empty()) {
      throw InputError(folder.string() + ": has no mesh to track; expected files .obj or .ply");
    }
    const Box box = recon::bounds_of(first_mesh(files));
    y_is_up_ = box.size().y() > box.size().z();
    const double height = y_is_up_ ? box.size().y() : box.size().z();
    if (height_m > 0 && height > 0) scale_ = height_m / height;
  }

  const std::vector<int64_t>& pulses() const override { return pulses_; }
  std::shared_ptr<const recon::ObservedPulse> read_surface(size_t index) override {
    return read(index);
  }
  recon::Texture colours(size_t, const Mesh&) override { return {}; }

 protected:
  std::shared_ptr<recon::ObservedPulse> load(size_t index) override {
    auto pulse = std::make_shared<recon::ObservedPulse>();
    pulse->pulse = pulses_[index];
    pulse->surface = read_mesh(files_[index]);
    for (Eigen::Vector3f& vertex : pulse->surface.vertices) {
      if (y_is_up_) vertex = {vertex.x(), -vertex.z(), vertex.y()};
      vertex *= static_cast<float>(scale_);
    }
    return pulse;
  }

 private:
  std::vector<fs::path> files_;
  std::vector<int64_t> pulses_;
  bool y_is_up_ = false;
  double scale_ = 1;
};

}  // namespace

std::shared_ptr<const recon::ObservedPulse> ObservedPulses::read(size_t index) {
  for (const auto& [number, pulse] : kept_) {
    if (number == index) return pulse;
  }
  if (kept_.size() == kKeptPulses) kept_.erase(kept_.begin());
  return kept_.emplace_back(index, load(index)).second;
}

std::vector<fs::path> mesh_files(const fs::path& folder) {
  std::vector<fs::path> files;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
    const fs::path extension = entry.path().extension();
    if (extension == ".obj" || extension == ".ply") files.push_back(entry.path());
  }
  std::ranges::sort(files, is_before_by_numbers);
  return files;
}

std::unique_ptr<ObservedPulses> open_take_pulses(const fs::path& take, take::FrameRange frames) {
  info_of_ended_take({take});
  return std::make_unique<TakePulses>(take, frames);
}

std::unique_ptr<ObservedPulses> open_mesh_folder(const fs::path& folder, double height_m,
                                                 take::FrameRange frames) {
  if (!fs::is_directory(folder)) {
    throw InputError(folder.string() + ": is not a folder; expected one with meshes (.obj, .ply)");
  }
  return std::make_unique<FolderMeshes>(folder, height_m, frames);
}

}  // namespace v3d::ctl
