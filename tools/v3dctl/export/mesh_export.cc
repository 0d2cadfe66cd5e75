#include "v3dctl/export/mesh_export.h"

#include <fmt/core.h>

#include <algorithm>
#include <map>
#include <numeric>
#include <string>
#include <vector>

#include "base/core/error.h"
#include "base/core/text.h"
#include "base/io/file.h"
#include "common/console.h"
#include "common/mesh_formats.h"
#include "daemon/recorded/mesh_frames.h"
#include "take/take.h"
#include "v3dctl/options.h"

namespace v3d::ctl {

MeshFormat parse_mesh_format(std::string_view text) {
  if (text == "ply") return MeshFormat::kPly;
  if (text == "obj") return MeshFormat::kObj;
  if (text == "glb") return MeshFormat::kGlb;
  throw InputError(
      "--format " + std::string(text) +
      ": expected ply, obj, glb, glb-sequence, usda, volume, colmap, nerfstudio or flac");
}

Compression parse_compression(std::string_view text) {
  if (text == "none") return Compression::kNone;
  if (text == "draco") return Compression::kDraco;
  if (text == "meshopt") return Compression::kMeshopt;
  throw InputError("--compress " + std::string(text) + ": expected none, draco or meshopt");
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

std::string attribute_name(std::string_view camera) {
  std::string name(camera);
  for (char& c : name) {
    const bool plain = (c >= '0' && c <= '9') || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z');
    if (!plain) c = '_';
  }
  return name;
}

void check_options(MeshFormat format, Compression compression, bool by_camera, bool with_atlas) {
  if (compression != Compression::kNone && format != MeshFormat::kGlb) {
    throw InputError("--compress: expected --format glb, the only one with compression");
  }
  if (by_camera && format == MeshFormat::kObj) {
    throw InputError(
        "--view-dependent: expected --format ply or glb; OBJ has one colour for a vertex");
  }
  if (!with_atlas) return;
  if (format != MeshFormat::kGlb) throw InputError("--atlas: expected --format glb or volume");
  if (by_camera) throw InputError("--atlas: expected no --view-dependent");
  if (compression == Compression::kDraco) {
    throw InputError("--atlas: expected --compress none or meshopt");
  }
}

namespace {

/// One property for each channel: cam01_red, cam01_green, cam01_blue, cam01_sight.
std::vector<PlyColours> ply_colours(std::span<const ExportedCamera> cameras) {
  std::vector<PlyColours> colours;
  for (const ExportedCamera& camera : cameras) {
    const std::string name = attribute_name(camera.colours.camera);
    const std::string pose = fmt::format(
        " stands at {:.6g} {:.6g} {:.6g} and looks along {:.6g} {:.6g} {:.6g}", camera.centre.x(),
        camera.centre.y(), camera.centre.z(), camera.axis.x(), camera.axis.y(), camera.axis.z());
    colours.push_back(
        {.comment = name + pose,
         .properties = {name + "_red", name + "_green", name + "_blue", name + "_sight"},
         .vertices = camera.colours.vertices});
  }
  return colours;
}

}  // namespace

void remove_unused_vertices(Mesh& mesh, std::vector<ExportedCamera>& cameras) {
  std::vector<uint8_t> is_used(mesh.vertices.size(), 0);
  for (const auto& triangle : mesh.triangles) {
    for (const uint32_t v : triangle) is_used[v] = 1;
  }
  const auto keep_used = [&](auto& values) {
    size_t kept = 0;
    for (size_t v = 0; v < values.size(); ++v) {
      if (is_used[v] != 0) values[kept++] = values[v];
    }
    values.resize(kept);
  };
  keep_used(mesh.vertices);
  keep_used(mesh.colours);
  for (ExportedCamera& camera : cameras) keep_used(camera.colours.vertices);
  std::vector<uint32_t> numbers(is_used.size());
  std::exclusive_scan(is_used.begin(), is_used.end(), numbers.begin(), uint32_t{0});
  for (auto& triangle : mesh.triangles) {
    for (uint32_t& v : triangle) v = numbers[v];
  }
}

void write_mesh(const std::filesystem::path& path, MeshFormat format, const Mesh& mesh,
                const MeshFileOptions& options) {
  switch (format) {
    case MeshFormat::kPly:
      return write_ply(path, mesh, ply_colours(options.cameras));
    case MeshFormat::kObj:
      return write_obj(path, mesh);
    case MeshFormat::kGlb:
      return write_glb(path, mesh, options);
  }
}

void write_obj(const std::filesystem::path& path, const Mesh& mesh) {
  std::string text = "# metres, z up\n";
  for (size_t i = 0; i < mesh.vertices.size(); ++i) {
    const Eigen::Vector3f& p = mesh.vertices[i];
    text += fmt::format("v {:.9g} {:.9g} {:.9g}", p.x(), p.y(), p.z());
    if (!mesh.colours.empty()) {
      const Rgb8 c = mesh.colours[i];
      text += fmt::format(" {:.6g} {:.6g} {:.6g}", c.r / 255.0, c.g / 255.0, c.b / 255.0);
    }
    text += '\n';
  }
  for (const std::array<uint32_t, 3>& t : mesh.triangles) {
    text += fmt::format("f {} {} {}\n", t[0] + 1, t[1] + 1, t[2] + 1);
  }
  replace_file(path, text);
}

namespace {

namespace fs = std::filesystem;

void require_distinct(const std::vector<std::string>& cameras) {
  std::map<std::string, std::string> camera_of;
  for (const std::string& camera : cameras) {
    std::string name = attribute_name(camera);
    std::transform(name.begin(), name.end(), name.begin(),
                   [](unsigned char c) { return std::tolower(c); });
    const auto [before, added] = camera_of.emplace(name, camera);
    if (!added) {
      throw InputError("--view-dependent: the cameras " + before->second + " and " + camera +
                       " have the same attribute name, " + name);
    }
  }
}

}  // namespace

void PerformerFilter::apply(recon::CompactFrame& frame, std::vector<ExportedCamera>& cameras) {
  if (performer_ == 0) return;
  if (frame.performers.empty()) {
    if (frame.mesh.triangles.empty()) return;  // a pulse without a surface has no labels
    throw InputError("--performer: frame " + std::to_string(frame.pulse) +
                     " does not state performers; expected a take after v3dctl performers " +
                     take_.string());
  }
  frame.mesh.triangles = recon::triangles_of_performer(frame.mesh, frame.performers, performer_);
  remove_unused_vertices(frame.mesh, cameras);
  is_present_ = is_present_ || !frame.mesh.triangles.empty();
}

void PerformerFilter::require_present() const {
  if (is_present()) return;
  throw InputError("--performer " + std::to_string(performer_) +
                   ": no exported frame shows this performer; v3dctl performers " + take_.string() +
                   " lists them");
}

void require_performer(recorded::MeshFrames& meshes, const std::vector<int64_t>& frames,
                       const fs::path& take, int performer) {
  PerformerFilter filter(take, performer);
  std::vector<ExportedCamera> no_cameras;
  for (size_t n = 0; n < frames.size() && !filter.is_present(); ++n) {
    stop_if_interrupted();
    recon::CompactFrame frame = meshes.read(frames[n]);
    filter.apply(frame, no_cameras);
  }
  filter.require_present();
}

const fs::path& require_raw_frames(const fs::path& take, const std::string& option) {
  const take::TakePaths paths{take};
  for (const std::string& camera : load_take_info(paths).cameras) {
    if (!fs::exists(paths.frames(camera))) {
      throw InputError(option + ": the take has no raw frames of " + camera + ": " +
                       paths.frames(camera).string() + " does not exist");
    }
  }
  return take;
}

int report_unfinished_meshes(const recorded::MeshFrames& meshes) {
  return meshes.is_unfinished() ? report_missing_index(meshes.path()) : kExitDone;
}

void report_missing_pulses(const take::TakeInfo& info, take::FrameRange range,
                           const std::vector<int64_t>& present) {
  const int64_t end = std::min(range.end, std::max(info.pulses, present.back() + 1));
  std::vector<std::string> missing;
  for (int64_t pulse = range.begin; pulse < end; ++pulse) {
    if (!std::binary_search(present.begin(), present.end(), pulse)) {
      missing.push_back(std::to_string(pulse));
    }
  }
  if (missing.empty()) return;
  note("v3dctl: left out, because they have no surface: " + count_of(std::ssize(missing), "pulse") +
       " (" + join_names(missing) + ")");
}

TakeColours::TakeColours(const fs::path& take)
    : frames_(require_raw_frames(take, "--view-dependent"), {}) {
  cameras_ = frames_.info().cameras;
  require_distinct(cameras_);
  std::ranges::sort(cameras_);
}

std::vector<ExportedCamera> TakeColours::of(const recon::CompactFrame& frame) {
  // Cameras that the reconstruction left out have colours, too.
  const recon::FrameSet set = observe_all(
      frame.pulse, recorded::read_used({frame.pulse, cameras_, frame.late_cameras}, frames_));
  if (set.frames.empty()) {
    throw InputError("--view-dependent: " + frames_.paths().folder.string() +
                     " has no raw frames of pulse " + std::to_string(frame.pulse));
  }
  if (set.frames.size() < frames_.rig().size()) ++incomplete_;
  std::vector<recon::CameraColours> visible =
      camera_colours(frame.mesh, recorded::texture_cameras(frames_.rig(), set),
                     recorded::texture_options(frame.mesh));
  std::vector<ExportedCamera> cameras;
  for (const RigCamera& camera : frames_.rig()) {
    const auto found = std::find_if(
        visible.begin(), visible.end(),
        [&](const recon::CameraColours& colours) { return colours.camera == camera.name; });
    ExportedCamera& exported = cameras.emplace_back();
    exported.centre = camera.model.center();
    exported.axis = camera.model.viewing_direction();
    exported.colours = {camera.name, {}};
    exported.colours.vertices.resize(frame.mesh.vertices.size());
    if (found != visible.end()) exported.colours = std::move(*found);
  }
  return cameras;
}

TexturePainter::TexturePainter(const std::filesystem::path& take, const std::string& option)
    : rig_(take::load_take_calib({take})), cameras_({take}) {
  const take::TakePaths paths{take};
  const std::vector<std::string> cameras = take::load_take_info(paths).cameras;
  const bool recorded = std::ranges::any_of(
      cameras, [&](const std::string& camera) { return file_exists(paths.frames(camera)); });
  if (recorded) {
    frames_.emplace(require_raw_frames(take, option), std::vector<std::string>());
    rig_ = frames_->rig();
  } else {
    note("v3dctl: the texture has the colours of vertices: " + take.string() +
         " has no raw frames");
  }
}

recon::AtlasLayout TexturePainter::layout_of(const Mesh& mesh, int side) const {
  return recorded::atlas_layout(rig_, mesh, side);
}

recon::AtlasColours TexturePainter::paint(const Mesh& mesh, const recon::AtlasLayout& layout,
                                          int64_t pulse, const Mesh* whole) {
  if (!frames_) return recon::colour_atlas(mesh, layout, {}, {});
  const recorded::UsedCameras used = cameras_.at(pulse);
  const recorded::FrameColours colours(*frames_, used);
  if (colours.cameras() < used.names.size()) ++incomplete_;
  return colours.atlas_colours(mesh, layout, whole);
}

}  // namespace v3d::ctl
