// Recorded meshes and their colours.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <vector>

#include "daemon/recorded/take_frames.h"
#include "recon/pipeline/compact_frame.h"
#include "recon/texture/atlas_colours.h"
#include "recon/texture/texture.h"
#include "recon/texture/texture_atlas.h"
#include "take/logs/mesh_file.h"
#include "take/take.h"

namespace v3d::recorded {

// Reader of the reconstructed frames of a take.

/// One thread.
class MeshFrames {
 public:
  /// Reads mesh.v3d, or motion.v3d of a take that has only that. Throws InputError if the folder is
  /// not a take, or if the take was not reconstructed.
  explicit MeshFrames(const std::filesystem::path& take);
  /// Reads `file` instead: a copy of the take's mesh.v3d, or a motion file of it. The frames of a
  /// motion file name the cameras of MeshCameras.
  MeshFrames(const std::filesystem::path& take, const std::filesystem::path& file);
  /// Reads proxy.v3d of the take. Throws InputError if the folder is not a take, or has no proxy.
  static MeshFrames of_proxy(const std::filesystem::path& take);
  ~MeshFrames();
  MeshFrames(MeshFrames&&) noexcept;
  MeshFrames& operator=(MeshFrames&&) noexcept;

  const std::filesystem::path& path() const { return path_; }
  /// Has the file no index, because it was truncated or its writer did not finish?
  bool is_unfinished() const;
  /// Whether the next frames are read with the views of cameras that they have. Call it before the
  /// first read().
  void enable_views(bool enabled);
  /// Numbers of the frames in the range, ascending. Throws InputError if there are none.
  std::vector<int64_t> frames(take::FrameRange range) const;
  /// Decodes a frame. Fast in ascending order; otherwise decoding starts at the previous key frame.
  /// Throws InputError if the frame, or one that it refers to, is missing, damaged, or cannot be
  /// read from the disk (with path and cause).
  recon::CompactFrame read(int64_t frame);

 private:
  class Reader;
  class MeshReader;
  class MotionReader;
  std::filesystem::path path_;
  std::unique_ptr<Reader> reader_;
};

/// Whether a file begins as a motion file. False for a file that cannot be read.
bool is_motion_file(const std::filesystem::path& path);

/// Which cameras made the surfaces of a take, for surfaces that do not state it. One thread.
class MeshCameras {
 public:
  /// Throws InputError if the folder is not a take, or its mesh.v3d is not a mesh file.
  explicit MeshCameras(const take::TakePaths& paths);
  /// The cameras that mesh.v3d names. Without a readable frame of this pulse there: all cameras of
  /// the take.
  UsedCameras at(int64_t pulse);

 private:
  std::vector<std::string> all_;                ///< ascending
  std::optional<take::MeshFileReader> meshes_;  ///< empty: the take has no mesh.v3d
};

// Vertex colours of a recorded frame from the images of the take: for one viewpoint (view-dependent
// rendering needs the images, which a compact frame does not contain), or for another surface.

/// Options for recorded frames: occlusion tolerance by the edge lengths of the mesh, and full
/// demosaicing, because there is no deadline.
recon::TextureOptions texture_options(const Mesh& mesh);

/// The frames of `set` with their cameras of `rig`. The result refers to both.
std::vector<recon::TextureCamera> texture_cameras(const Rig& rig, const recon::FrameSet& set);

/// The layout of an atlas of `mesh` with `side` texels. Its resolution is at most twice that of the
/// cameras of `rig` on the surface. Throws InputError as lay_out_atlas() does.
recon::AtlasLayout atlas_layout(const Rig& rig, const Mesh& mesh, int side);

/// Where view-dependent colours come from.
enum class ViewSource {
  kAutomatic,    ///< the raw frames of the take where it has those of all cameras, else its meshes
  kPhotographs,  ///< the raw frames
  kMesh,         ///< the views of cameras in its meshes
};
/// What kAutomatic means for `take`; any other source as it is. Throws InputError if the folder is
/// not a take.
ViewSource resolved(ViewSource source, const std::filesystem::path& take);

/// The images that made the surface of one pulse. One thread.
class FrameColours {
 public:
  /// Reads the frames. Throws InputError if the take has no readable frame of a camera of `frame`.
  FrameColours(const std::filesystem::path& take, const recon::CompactFrame& frame);
  /// The same with the logs of all cameras of `frame` open. Fast for increasing pulses.
  FrameColours(TakeFrames& frames, const recon::CompactFrame& frame);
  /// read_used() of the opened cameras; maybe none.
  FrameColours(TakeFrames& frames, const UsedCameras& used);
  /// The number of cameras with a frame.
  size_t cameras() const { return set_.frames.size(); }
  /// `mesh`, that of the frame or another one of the same pulse, with view-independent colours
  /// (equations 8 and 9).
  Mesh coloured(Mesh mesh) const;
  /// The colours of an atlas of `mesh`, which has colours of vertices: view-independent colours.
  /// `whole` is the surface of all performers, which may hide `mesh`; null: `mesh` is all.
  recon::AtlasColours atlas_colours(const Mesh& mesh, const recon::AtlasLayout& layout,
                                    const Mesh* whole = nullptr) const;
  /// An atlas of `mesh` with atlas_layout().
  recon::TextureAtlas atlas(const Mesh& mesh, int side) const;
  /// `mesh` with view-dependent colours for the viewpoint `eye` (Algorithm 2).
  Mesh coloured_for(const CameraModel& eye, Mesh mesh) const;

 private:
  Mesh coloured(Mesh mesh, std::optional<recon::ViewDependence> view) const;

  Rig rig_;
  recon::FrameSet set_;
};

/// View-dependent colours of one frame (Algorithm 2). One thread.
class ViewColours {
 public:
  /// `source`: resolved(). `frame` is read with its views for kMesh, and borrowed. Throws
  /// InputError if it has none, or as FrameColours().
  ViewColours(const std::filesystem::path& take, const recon::CompactFrame& frame,
              ViewSource source);
  /// Colours from the raw frames `photographs`. `frame` is borrowed. Throws as FrameColours().
  ViewColours(TakeFrames& photographs, const recon::CompactFrame& frame);
  /// The mesh of the frame with colours for the viewpoint `eye`.
  Mesh coloured_for(const CameraModel& eye) const;

 private:
  const recon::CompactFrame& frame_;
  std::optional<FrameColours> photographs_;  ///< empty: the views of the frame
};

}  // namespace v3d::recorded
