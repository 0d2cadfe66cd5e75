// Observed pulses for the tracker: from a reconstructed take, or from a folder of meshes.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "recon/motion/segment_tracker.h"
#include "recon/texture/texture.h"
#include "take/take.h"

namespace v3d::ctl {

/// Keeps some pulses that were read last. One thread.
class ObservedPulses {
 public:
  virtual ~ObservedPulses() = default;

  /// Pulse numbers, ascending.
  virtual const std::vector<int64_t>& pulses() const = 0;
  /// The pulse of an index. Works in the caller's TBB arena. Throws InputError for input that
  /// cannot be read.
  std::shared_ptr<const recon::ObservedPulse> read(size_t index);
  /// The same without frames: fast, because no image is read. The cameras are those that the mesh
  /// names, with silhouettes that are the whole image. Valid as long as this object.
  virtual std::shared_ptr<const recon::ObservedPulse> read_surface(size_t index) = 0;
  /// Vertex colours of a surface from the images of a pulse; none without images.
  virtual recon::Texture colours(size_t index, const Mesh& surface) = 0;
  /// True when the file of the meshes has no index: pulses may be missing.
  virtual bool is_unfinished() const { return false; }
  /// Read errors of images so far: lines with path and cause.
  virtual std::vector<std::string> read_errors() const { return {}; }

 protected:
  virtual std::shared_ptr<recon::ObservedPulse> load(size_t index) = 0;

 private:
  std::vector<std::pair<size_t, std::shared_ptr<const recon::ObservedPulse>>> kept_;
};

/// Pulses have the images of the cameras that took part in their meshes. Throws InputError for a
/// folder that is no take, for a take without meshes, and while a process records or recovers the
/// take.
std::unique_ptr<ObservedPulses> open_take_pulses(const std::filesystem::path& take,
                                                 take::FrameRange frames);

/// The files .obj and .ply of a folder, in the order of their numbers.
std::vector<std::filesystem::path> mesh_files(const std::filesystem::path& folder);

/// The mesh_files() of a folder; pulses count from 0.
/// `height_m`: extent along z of the first mesh of the folder that is not empty, after scaling; 0:
/// coordinates are metres. Meshes are turned where the y axis points up (the largest extent of that
/// mesh is along y). Throws InputError for a folder without meshes.
std::unique_ptr<ObservedPulses> open_mesh_folder(const std::filesystem::path& folder,
                                                 double height_m, take::FrameRange frames);

}  // namespace v3d::ctl
