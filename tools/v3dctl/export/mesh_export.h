// A coloured mesh as a file for other programs: one writer per format. docs/export.md tells users.
#pragma once

#include <filesystem>
#include <span>
#include <string_view>

#include "base/mesh.h"
#include "recon/camera_colours.h"
#include "recon/vertex_lattice.h"

namespace v3d::ctl {

enum class MeshFormat { kPly, kObj, kGlb };
enum class Compression { kNone, kDraco, kMeshopt };

/// "ply", "obj", "glb"; "none", "draco", "meshopt". Throw InputError for anything else.
MeshFormat parse_mesh_format(std::string_view text);
Compression parse_compression(std::string_view text);
std::string_view extension(MeshFormat format);  ///< with the dot

/// What one camera saw of the mesh, and from where.
struct ExportedCamera {
  CameraColours colours;
  Eigen::Vector3d centre{0, 0, 0};  ///< world, metres
  Eigen::Vector3d axis{0, 0, 1};    ///< where it looks: unit vector, world
};

struct MeshFileOptions {
  Compression compression = Compression::kNone;
  VertexLattice lattice = {};  ///< that the vertices lie on; a step of 0: not known
  /// Attributes of their own. Borrowed; each has a colour for every vertex. Requires names that
  /// differ, also as attribute_name().
  std::span<const ExportedCamera> cameras = {};
};

/// The camera's name with '_' for all but ASCII's letters and digits.
std::string attribute_name(std::string_view camera);

/// Throws InputError where the format cannot hold what the options ask for: other formats than GLB
/// know no compression, and OBJ no further attributes.
void check_options(MeshFormat format, Compression compression, bool by_camera);

/// Metres, z up, colours as in the images (sRGB); a mesh without colours is written without.
/// Replaces the file. Throws std::runtime_error when it cannot be written.
void write_mesh(const std::filesystem::path& path, MeshFormat format, const Mesh& mesh,
                const MeshFileOptions& options = {});

/// The parts of write_mesh(); PLY is common/ply_writer.h.
///   Wavefront OBJ with the widespread extension "v x y z r g b", colours 0..1.
void write_obj(const std::filesystem::path& path, const Mesh& mesh);
///   glTF 2.0 binary: POSITION, COLOR_0 (linear light, as the standard wants) and _<CAMERA>_COLOR,
///   unlit, with a node that turns z up into the standard's y up. A mesh without triangles gives an
///   empty scene. Compressed: positions on the options' lattice, triangles and vertices in another
///   order.
void write_glb(const std::filesystem::path& path, const Mesh& mesh, const MeshFileOptions& options);

}  // namespace v3d::ctl
