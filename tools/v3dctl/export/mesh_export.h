// Export of a coloured mesh: one writer for each file format (docs/export.md), and the colours and
// textures from the raw frames of its take.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/geometry/camera_model.h"
#include "base/geometry/mesh.h"
#include "daemon/recorded/mesh_frames.h"
#include "daemon/recorded/take_frames.h"
#include "recon/pipeline/compact_frame.h"
#include "recon/texture/atlas_colours.h"
#include "recon/texture/texture.h"
#include "recon/texture/texture_atlas.h"
#include "take/take_sound.h"

namespace v3d::ctl {

enum class MeshFormat { kPly, kObj, kGlb };
enum class Compression { kNone, kDraco, kMeshopt };

/// Parse "ply", "obj", "glb" and "none", "draco", "meshopt". Throw InputError for other text.
MeshFormat parse_mesh_format(std::string_view text);
Compression parse_compression(std::string_view text);
std::string_view extension(MeshFormat format);  ///< with the dot

/// Colours of the mesh in one camera, and the pose of that camera.
struct ExportedCamera {
  recon::CameraColours colours;
  Eigen::Vector3d centre{0, 0, 0};  ///< world, metres
  Eigen::Vector3d axis{0, 0, 1};    ///< viewing direction: unit vector, world
};

struct MeshFileOptions {
  Compression compression = Compression::kNone;
  VertexLattice lattice = {};  ///< of the vertices; a step of 0: unknown
  /// Additional attributes. Borrowed; each has a colour for every vertex. Requires distinct
  /// attribute_name()s.
  std::span<const ExportedCamera> cameras = {};
  /// GLB: the texture of the mesh, in place of colours of vertices, as a JPEG image in the file.
  /// Its image may be smaller than the layout. Borrowed. Excludes Draco and `cameras`.
  const recon::TextureAtlas* atlas = nullptr;
  int atlas_quality = 92;  ///< of JPEG, 1 to 100
  /// With `atlas`: the attribute _VERTEX has the number of each vertex before seams divided it.
  bool number_vertices = false;
  /// GLB: the pulse of the surface and its timecode, for the extras of the node; empty: none.
  int64_t pulse = 0;
  std::optional<take::PulseTimecode> timecode = std::nullopt;
};

/// The camera's name with '_' for characters other than ASCII letters and digits.
std::string attribute_name(std::string_view camera);

/// Throws InputError for options that the format does not support: compression of formats other
/// than GLB, colours of cameras in OBJ, and a texture in formats other than GLB or beside Draco or
/// colours of cameras.
void check_options(MeshFormat format, Compression compression, bool by_camera, bool with_atlas);

/// Removes the vertices that no triangle uses, with their colours, also those in `cameras`.
void remove_unused_vertices(Mesh& mesh, std::vector<ExportedCamera>& cameras);

/// Writes metres, z up, sRGB colours; a mesh without colours is written without. Replaces the file
/// atomically. Throws std::runtime_error for errors of the disk.
void write_mesh(const std::filesystem::path& path, MeshFormat format, const Mesh& mesh,
                const MeshFileOptions& options = {});

/// Wavefront OBJ with the common extension "v x y z r g b", colours 0 to 1.
void write_obj(const std::filesystem::path& path, const Mesh& mesh);

/// glTF 2.0 binary: POSITION, COLOR_0 (linear light), _<CAMERA>_COLOR, or with an atlas POSITION
/// and TEXCOORD_0; unlit. A node rotates z up to the y up of the standard. A mesh without triangles
/// gives an empty scene. The extras of the node are timecode_extras(). Compression quantises
/// positions to the lattice of the options and reorders triangles and vertices.
void write_glb(const std::filesystem::path& path, const Mesh& mesh, const MeshFileOptions& options);

/// Removes all performers but one from frames of a take. One thread.
class PerformerFilter {
 public:
  /// `performer` 0: removes nothing.
  PerformerFilter(std::filesystem::path take, int performer)
      : take_(std::move(take)), performer_(performer) {}
  /// Removes triangles and vertices, of the latter the colours in `cameras`, too. Throws InputError
  /// for a frame with a surface that does not state performers.
  void apply(recon::CompactFrame& frame, std::vector<ExportedCamera>& cameras);
  /// Has a frame shown the performer? Always true for performer 0.
  bool is_present() const { return performer_ == 0 || is_present_; }
  /// Throws InputError unless a frame showed the performer.
  void require_present() const;

 private:
  std::filesystem::path take_;
  int performer_;
  bool is_present_ = false;
};

/// Throws InputError unless one of the `frames` shows the performer; 0: any. Reads frames until one
/// does. Throws std::runtime_error after an interrupt.
void require_performer(recorded::MeshFrames& meshes, const std::vector<int64_t>& frames,
                       const std::filesystem::path& take, int performer);

/// Returns `take`. Throws InputError, beginning with `option`, for a take that was kept without the
/// raw frames of a camera.
const std::filesystem::path& require_raw_frames(const std::filesystem::path& take,
                                                const std::string& option);

/// Reports on stderr when the file of `meshes` has no index. Returns kExitDone or kExitIncomplete.
int report_unfinished_meshes(const recorded::MeshFrames& meshes);

/// Names the pulses of `range` without a surface in a line on stderr. `present`: those with one,
/// ascending; at least one.
void report_missing_pulses(const take::TakeInfo& info, take::FrameRange range,
                           const std::vector<int64_t>& present);

// Vertex colours of reconstructed frames in each camera, from the raw frames of the take.

/// One thread; uses several processors.
class TakeColours {
 public:
  /// Throws InputError for a folder that is no take, for a take without raw frames, and for cameras
  /// with equal attribute_name()s.
  explicit TakeColours(const std::filesystem::path& take);
  /// Colours of `frame` in all cameras of the take, ordered by name. In a camera without a frame of
  /// this pulse no vertex is visible. Throws InputError when no camera
  /// has one. Fast for increasing pulses.
  std::vector<ExportedCamera> of(const recon::CompactFrame& frame);
  /// Number of frames so far in which a camera was missing or unreadable.
  int64_t incomplete() const { return incomplete_; }

 private:
  recorded::TakeFrames frames_;
  std::vector<std::string> cameras_;  ///< ascending
  int64_t incomplete_ = 0;
};

// Textures of the surfaces of a take, from its raw frames.

/// One thread; uses several processors. Fast for increasing pulses.
class TexturePainter {
 public:
  /// A take without raw frames, such as an edited one, gets the colours of vertices; a line on
  /// stderr says so. Throws InputError, beginning with `option`, when only some cameras have them.
  TexturePainter(const std::filesystem::path& take, const std::string& option);

  /// recorded::atlas_layout() with the cameras of the take.
  recon::AtlasLayout layout_of(const Mesh& mesh, int side) const;
  /// The colours of `mesh`, which has colours of vertices, at a pulse, from the cameras that took
  /// part in its reconstruction (recorded::MeshCameras). `whole` is the surface of
  /// all performers, which may hide `mesh`; null: `mesh` is all.
  recon::AtlasColours paint(const Mesh& mesh, const recon::AtlasLayout& layout, int64_t pulse,
                            const Mesh* whole = nullptr);
  /// Number of pulses so far in which such a camera was missing or unreadable.
  int64_t incomplete() const { return incomplete_; }

 private:
  /// Of the cameras that were recorded; calib.toml has all cameras of the studio.
  Rig rig_;
  recorded::MeshCameras cameras_;
  std::optional<recorded::TakeFrames> frames_;
  int64_t incomplete_ = 0;
};

}  // namespace v3d::ctl
