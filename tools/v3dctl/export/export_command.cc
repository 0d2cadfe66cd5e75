// export: writes the meshes of a take as files for other programs.
#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <optional>
#include <string_view>

#include "base/core/error.h"
#include "base/core/text.h"
#include "common/console.h"
#include "daemon/recorded/mesh_frames.h"
#include "take/take_sound.h"
#include "v3dctl/command_line.h"
#include "v3dctl/export/mesh_export.h"
#include "v3dctl/export/take_export.h"
#include "v3dctl/export/volume_export.h"
#include "v3dctl/mesh_options.h"
#include "v3dctl/options.h"

namespace v3d::ctl {
namespace {

namespace fs = std::filesystem;

struct Arguments {
  fs::path take;
  fs::path out;
  std::string format;
  std::string compression = "none";
  bool view_dependent = false;
  std::string frames;
  int performer = 0;                  ///< 0: all
  std::string surface = "automatic";  ///< see parse_surface()
  int atlas_side = 0;                 ///< texels; 0: none, or that of VolumeExport
  bool uncompressed = false;
  bool proxy = false;
};

std::string file_name(int64_t frame, MeshFormat format) {
  return fmt::format("{:06}{}", frame, extension(format));
}

/// Does the name end as that of a file of a surface, in small or capital letters?
bool has_surface_extension(const fs::path& path) {
  constexpr std::array<std::string_view, 5> kExtensions{".ply", ".obj", ".glb", ".gltf", ".usda"};
  std::string ending = path.extension().string();
  std::ranges::transform(ending, ending.begin(),
                         [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return std::ranges::find(kExtensions, ending) != kExtensions.end();
}

/// A path with the extension of the format is a file of one frame; any other is a folder. Throws
/// InputError for a new folder that would look like a file.
bool is_file(const Arguments& arguments, MeshFormat format, size_t frames) {
  if (arguments.out.extension() != extension(format)) {
    if (!has_surface_extension(arguments.out) || fs::is_directory(arguments.out)) return false;
    throw InputError(fmt::format("{}: expected a name that ends in {}, or a folder",
                                 arguments.out.string(), extension(format)));
  }
  if (frames > 1) {
    throw InputError(arguments.out.string() + ": is a file of one frame, the take has " +
                     std::to_string(frames) + "; expected --frames N, or a folder");
  }
  return true;
}

void expect_mesh_options_unused(const Arguments& arguments) {
  if (arguments.compression != "none") throw InputError("--compress: expected --format glb");
  if (arguments.view_dependent) throw InputError("--view-dependent: expected --format ply or glb");
}

int run_volume_export(const Arguments& arguments) {
  expect_mesh_options_unused(arguments);
  if (arguments.proxy) {
    throw InputError("--proxy: --format volume contains tracked surfaces; expected no --proxy");
  }
  if (arguments.performer > 0) {
    throw InputError("--performer: tracked surfaces state no performers; expected no --performer");
  }
  if (parse_surface(arguments.surface) == Surface::kMeshes) {
    throw InputError("--surface meshes: --format volume contains tracked surfaces");
  }
  if (arguments.atlas_side % 2 != 0) {
    throw InputError("--atlas " + std::to_string(arguments.atlas_side) +
                     ": expected an even number for a video");
  }
  VolumeExport request{.take = arguments.take,
                       .out = arguments.out,
                       .frames = parse_frame_range(arguments.frames),
                       .uncompressed = arguments.uncompressed};
  if (arguments.atlas_side > 0) request.atlas_side = arguments.atlas_side;
  return export_volume(request);
}

int run_flac_export(const Arguments& arguments) {
  expect_mesh_options_unused(arguments);
  if (arguments.atlas_side > 0) throw InputError("--atlas: expected --format glb or volume");
  if (arguments.proxy) throw InputError("--proxy: --format flac has no surfaces");
  if (arguments.performer > 0) throw InputError("--performer: --format flac has no surfaces");
  if (parse_surface(arguments.surface) != Surface::kAutomatic) {
    throw InputError("--surface: expected --format glb-sequence or usda");
  }
  if (!arguments.frames.empty()) {
    throw InputError("--frames: --format flac writes whole sound files; expected no --frames");
  }
  return export_flac(arguments.take, arguments.out);
}

int run_take_export(const Arguments& arguments, TakeFormat format) {
  expect_mesh_options_unused(arguments);
  if (arguments.atlas_side > 0) throw InputError("--atlas: expected --format glb or volume");
  return export_take(
      {.take = arguments.take,
       .out = arguments.out,
       .format = format,
       .frames = parse_frame_range(arguments.frames),
       .performer = arguments.performer,
       .surface = arguments.proxy ? Surface::kProxy : parse_surface(arguments.surface)});
}

/// A texture in place of the colours of vertices, which it removes; empty without triangles.
/// `whole` is the surface of all performers.
std::optional<recon::TextureAtlas> take_texture(TexturePainter& painter, int side,
                                                const Mesh& whole, recon::CompactFrame& content) {
  if (content.mesh.triangles.empty()) return {};
  recon::AtlasLayout layout = painter.layout_of(content.mesh, side);
  Image image = painter.paint(content.mesh, layout, content.pulse, &whole).image;
  content.mesh.colours.clear();
  return recon::TextureAtlas{std::move(layout), std::move(image)};
}

/// Throws InputError when it cannot be created.
void create_folder(const fs::path& folder) {
  std::error_code error;
  if (fs::create_directories(folder, error) || fs::is_directory(folder)) return;
  throw InputError(folder.string() + ": cannot create the folder: " + error.message());
}

int run(const Arguments& arguments) {
  if (arguments.format == "volume") return run_volume_export(arguments);
  if (arguments.uncompressed) throw InputError("--uncompressed: expected --format volume");
  if (arguments.format == "flac") return run_flac_export(arguments);
  if (const auto format = parse_take_format(arguments.format)) {
    return run_take_export(arguments, *format);
  }
  if (parse_surface(arguments.surface) != Surface::kAutomatic) {
    throw InputError("--surface: expected --format glb-sequence or usda");
  }
  const MeshFormat format = parse_mesh_format(arguments.format);
  const Compression compression = parse_compression(arguments.compression);
  check_options(format, compression, arguments.view_dependent, arguments.atlas_side > 0);
  recorded::MeshFrames meshes = open_meshes(arguments.take, arguments.proxy);
  const take::FrameRange range = parse_frame_range(arguments.frames);
  const std::vector<int64_t> frames = meshes.frames(range);
  const bool to_file = is_file(arguments, format, frames.size());
  catch_interrupts();
  // Before the first file is written: a wrong number would replace files by empty ones.
  require_performer(meshes, frames, arguments.take, arguments.performer);
  report_missing_pulses(take::load_take_info({arguments.take}), range, frames);
  std::optional<TakeColours> colours;
  if (arguments.view_dependent) colours.emplace(arguments.take);
  std::optional<TexturePainter> painter;
  if (arguments.atlas_side > 0) painter.emplace(arguments.take, "--atlas");
  Progress progress("export", std::ssize(frames));
  PerformerFilter performer(arguments.take, arguments.performer);
  const take::TakeTimecode timecodes({arguments.take});
  for (const int64_t frame : frames) {
    stop_if_interrupted();
    const fs::path file = to_file ? arguments.out : arguments.out / file_name(frame, format);
    recon::CompactFrame content = meshes.read(frame);
    std::vector<ExportedCamera> cameras;
    if (colours) cameras = colours->of(content);
    const Mesh whole = painter ? content.mesh : Mesh();
    performer.apply(content, cameras);
    std::optional<recon::TextureAtlas> atlas;
    if (painter) atlas = take_texture(*painter, arguments.atlas_side, whole, content);
    // Not earlier: a failure of the first frame leaves no empty folder.
    if (!to_file && frame == frames.front()) create_folder(arguments.out);
    write_mesh(file, format, content.mesh,
               {.compression = compression,
                .lattice = content.lattice,
                .cameras = cameras,
                .atlas = atlas ? &*atlas : nullptr,
                .pulse = frame,
                .timecode = timecodes.at(frame)});
    progress.advance();
  }
  const int64_t incomplete =
      colours ? colours->incomplete() : (painter ? painter->incomplete() : 0);
  const int status = report_incomplete_frames(incomplete, arguments.take);
  return std::max(status, report_unfinished_meshes(meshes));
}

}  // namespace

void add_export(CommandLine& line) {
  cli::Command command = line.add(
      "export",
      "Write meshes for other programs: a file for each frame, one for all, a delivery with video "
      "texture, training sets, or sound",
      {"v3dctl export dancer --format glb --frames 12 dancer.glb",
       "v3dctl export dancer --format ply --frames 0:250 meshes/   # meshes/000000.ply, ...",
       "v3dctl export dancer --format glb --compress draco --view-dependent meshes/",
       "v3dctl export dancer --format glb --atlas 2048 --frames 12 dancer.glb",
       "v3dctl export dancer --format glb-sequence dancer.glb",
       "v3dctl export dancer --format glb-sequence --proxy preview.glb",
       "v3dctl export dancer --format volume dancer-volume",
       "v3dctl export dancer --format colmap --frames 12 training/",
       "v3dctl export dancer --format flac sound/"});
  auto arguments = std::make_shared<Arguments>();
  command.add_option("TAKE", arguments->take, "The folder of a reconstructed take").required();
  command
      .add_option(
          "OUT", arguments->out,
          "A folder for FRAME.ply and so on, or a file for one frame; glb-sequence and usda: a "
          "file; volume, colmap, nerfstudio and flac: a new folder")
      .required();
  command
      .add_option("--format", arguments->format,
                  "The file format; surfaces have colours, metres, z up (glb, glb-sequence: y up); "
                  "flac: the take's sound")
      .type_name("ply|obj|glb|glb-sequence|usda|volume|colmap|nerfstudio|flac")
      .required();
  command
      .add_option("--compress", arguments->compression,
                  "glb only: with KHR_draco_mesh_compression or EXT_meshopt_compression; "
                  "positions keep their accuracy up to 65,535 lattice steps (docs/export.md)")
      .type_name("none|draco|meshopt")
      .show_default();
  command.add_flag("--view-dependent", arguments->view_dependent,
                   "ply, glb: also the colour of every vertex in each camera, from the take's raw "
                   "frames, as attributes (docs/export.md)");
  command
      .add_option(
          "--atlas", arguments->atlas_side,
          "glb, volume: the side of a texture atlas from the take's raw frames, in place of "
          "colours of vertices (volume: otherwise 2048)")
      .type_name("TEXELS")
      .check(cli::integer_in(recon::kMinAtlasSide, recon::kMaxAtlasSide));
  command.add_flag("--uncompressed", arguments->uncompressed,
                   "volume: also the texture of every pulse as a PNG file, textures/FRAME.png");
  cli::Option performer = command
                              .add_option("--performer", arguments->performer,
                                          "One performer alone, of a take after v3dctl performers")
                              .type_name("N")
                              .check(cli::integer_in(1, 255));
  cli::Option surface =
      command
          .add_option(
              "--surface", arguments->surface,
              "glb-sequence, usda: mesh.v3d, or motion.v3d, with constant triangles; automatic: "
              "motion.v3d where it exists")
          .type_name("automatic|meshes|tracked")
          .show_default();
  add_proxy_flag(command, arguments->proxy).excludes(performer).excludes(surface);
  add_frames_option(command, arguments->frames);
  line.on_run(command, [arguments] { return run(*arguments); });
}

}  // namespace v3d::ctl
