#include "v3dctl/mesh_export.h"

#include <cstdio>
#include <string>

#include "base/error.h"
#include "base/file.h"
#include "common/ply_writer.h"

namespace v3d::ctl {

MeshFormat parse_mesh_format(std::string_view text) {
  if (text == "ply") return MeshFormat::kPly;
  if (text == "obj") return MeshFormat::kObj;
  if (text == "glb") return MeshFormat::kGlb;
  throw InputError("--format " + std::string(text) + ": want ply, obj or glb");
}

std::string_view extension(MeshFormat format) {
  switch (format) {
    case MeshFormat::kPly:
      return ".ply";
    case MeshFormat::kObj:
      return ".obj";
    case MeshFormat::kGlb:
      return ".glb";
  }
  return "";
}

void write_mesh(const std::filesystem::path& path, MeshFormat format, const Mesh& mesh) {
  switch (format) {
    case MeshFormat::kPly:
      return write_ply(path, mesh);
    case MeshFormat::kObj:
      return write_obj(path, mesh);
    case MeshFormat::kGlb:
      return write_glb(path, mesh);
  }
}

void write_obj(const std::filesystem::path& path, const Mesh& mesh) {
  std::string text = "# metres, z up\n";
  char line[128];
  for (size_t i = 0; i < mesh.vertices.size(); ++i) {
    const Eigen::Vector3f& p = mesh.vertices[i];
    std::snprintf(line, sizeof line, "v %.9g %.9g %.9g", p.x(), p.y(), p.z());
    text += line;
    if (!mesh.colours.empty()) {
      const Rgb8 c = mesh.colours[i];
      std::snprintf(line, sizeof line, " %.6g %.6g %.6g", c.r / 255.0, c.g / 255.0, c.b / 255.0);
      text += line;
    }
    text += '\n';
  }
  for (const std::array<uint32_t, 3>& t : mesh.triangles) {
    std::snprintf(line, sizeof line, "f %u %u %u\n", t[0] + 1, t[1] + 1, t[2] + 1);
    text += line;
  }
  replace_file(path, text);
}

}  // namespace v3d::ctl
