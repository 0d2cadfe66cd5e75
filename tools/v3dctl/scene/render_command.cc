// render: draws a frame of a take, or a scene.
#include <fmt/core.h>

#include <optional>

#include "base/core/error.h"
#include "base/core/text.h"
#include "base/geometry/rigid_transform.h"
#include "base/image/image.h"
#include "base/image/image_files.h"
#include "cli/command.h"
#include "common/console.h"
#include "daemon/recorded/mesh_frames.h"
#include "daemon/recorded/take_frames.h"
#include "recon/render/renderer.h"
#include "v3dctl/command_line.h"
#include "v3dctl/export/mesh_export.h"
#include "v3dctl/mesh_options.h"
#include "v3dctl/options.h"
#include "v3dctl/scene/scene_renderer.h"
#include "v3dctl/scene/scene_sound.h"
#include "v3dctl/scene/scene_video.h"

namespace v3d::ctl {
namespace {

constexpr ImageSize kTurntableView{480, 560};

namespace fs = std::filesystem;

struct Arguments {
  fs::path take;
  fs::path out;
  fs::path scene;
  std::optional<double> at_s;
  std::string frames;
  std::string size = "1280x720";
  int64_t frame = -1;
  std::string camera;
  int turntable = 0;
  bool view_dependent = false;
  std::string view_source = "automatic";
  bool proxy = false;
};

/// Throws InputError for a proxy without raw frames.
recorded::ViewSource view_source(const Arguments& arguments) {
  const recorded::ViewSource source = resolved_view_source(arguments.view_source, arguments.take);
  if (arguments.proxy && source == recorded::ViewSource::kMesh) {
    throw InputError("--view-dependent: " + take::TakePaths{arguments.take}.proxy().string() +
                     " has no colours of cameras; expected the raw frames of the take, or no "
                     "--proxy");
  }
  return source;
}

/// Renders a frame, with view-dependent colours if requested.
class FrameRenderer {
 public:
  /// `frame` is borrowed.
  FrameRenderer(const Arguments& arguments, const recon::CompactFrame& frame) : mesh_(frame.mesh) {
    if (arguments.view_dependent) colours_.emplace(arguments.take, frame, view_source(arguments));
  }
  const Mesh& mesh() const { return mesh_; }
  Image draw(const CameraModel& camera, const recon::DrawOptions& options) const {
    return draw_mesh(colours_ ? colours_->coloured_for(camera) : mesh_, camera, options);
  }

 private:
  const Mesh& mesh_;
  std::optional<recorded::ViewColours> colours_;
};

Image render_camera(const Arguments& arguments, const FrameRenderer& renderer) {
  const take::TakePaths paths{arguments.take};
  const Rig rig = load_take_calib(paths);
  const int index = find_camera(rig, arguments.camera);
  if (index < 0) {
    std::vector<std::string> names;
    for (const RigCamera& camera : rig) names.push_back(camera.name);
    throw InputError("--camera " + arguments.camera + ": not in " + paths.calib().string() +
                     "; expected one of " + join_names(names));
  }
  return renderer.draw(rig[static_cast<size_t>(index)].model, {});
}

// A floor for objects of the size of people; its grid would hide much smaller ones.
std::optional<recon::FloorOptions> floor_under(const Box& bounds) {
  if (bounds.size().maxCoeff() < 0.5) return std::nullopt;
  recon::FloorOptions floor;
  floor.z = bounds.min.z();
  return floor;
}

Image turntable(const FrameRenderer& renderer, int views, int64_t frame) {
  if (renderer.mesh().vertices.empty()) {
    throw InputError("--turntable: frame " + std::to_string(frame) + " has no surface");
  }
  const Box bounds = recon::bounds_of(renderer.mesh());
  recon::DrawOptions options;
  options.head_light = 0.3;
  options.floor = floor_under(bounds);
  std::vector<Image> images;
  for (const CameraModel& camera : recon::turntable_cameras(bounds, views, kTurntableView)) {
    images.push_back(renderer.draw(camera, options));
  }
  return recon::contact_sheet(images);
}

/// Range of pictures of the scene.
take::FrameRange frames_of(const Arguments& arguments, const Scene& scene) {
  take::FrameRange range = parse_frame_range(arguments.frames);
  range.end = std::min(range.end, scene.frames());
  if (range.begin < range.end) return range;
  throw InputError("--frames " + arguments.frames +
                   " is beyond the scene, which has pictures 0 to " +
                   std::to_string(scene.frames() - 1));
}

void draw_video(SceneRenderer& renderer, const Arguments& arguments, take::FrameRange range,
                ImageSize size) {
  const double rate_hz = renderer.scene().rate_hz;
  SceneSound sound(renderer.clips(), renderer.scene().time_of(range.begin));
  for (const std::string& file : sound.unplayed()) {
    note("v3dctl: " + file + ": has no map of pulses; the video is without this sound");
  }
  std::optional<SceneSoundFile> sound_file;
  if (!sound.is_silent()) {
    const auto pictures = static_cast<double>(range.end - range.begin);
    sound_file.emplace(sound, arguments.out, pictures / rate_hz);
  }
  const SceneTimecode timecode =
      scene_timecode(renderer.clips(), renderer.scene().time_of(range.begin), rate_hz);
  if (!timecode.problem.empty()) {
    note("v3dctl: " + arguments.scene.string() + ": its takes have no single timecode: " +
         timecode.problem + "; the video is without timecode");
  }
  VideoWriter video(
      arguments.out, size, rate_hz,
      {.sound = sound_file ? sound_file->path() : fs::path(), .timecode = timecode.text});
  Progress progress("render", range.end - range.begin);
  for (int64_t frame = range.begin; frame < range.end; ++frame) {
    stop_if_interrupted();
    video.add(renderer.draw(frame));
    progress.advance();
  }
  video.close();
}

void draw_folder(SceneRenderer& renderer, const Arguments& arguments, take::FrameRange range) {
  std::error_code error;
  if (!fs::create_directories(arguments.out, error) && !fs::is_directory(arguments.out)) {
    throw InputError(arguments.out.string() + ": cannot create the folder: " + error.message());
  }
  Progress progress("render", range.end - range.begin);
  for (int64_t frame = range.begin; frame < range.end; ++frame) {
    stop_if_interrupted();
    const std::string name = fmt::format("{:06}.png", frame);
    write_png(arguments.out / name, renderer.draw(frame).view());
    progress.advance();
  }
}

int run_scene(const Arguments& arguments) {
  const bool picture = arguments.out.extension() == ".png";
  if (picture != arguments.at_s.has_value()) {
    throw InputError(picture ? "render: expected --at SECONDS for one picture of a scene"
                             : "--at: expected a name that ends in .png for one picture");
  }
  if (!picture && arguments.out.has_extension() && !VideoWriter::writes(arguments.out) &&
      !fs::is_directory(arguments.out)) {
    throw InputError(arguments.out.string() +
                     ": expected a folder, or a name that ends in .png, .mp4, .mov, .mkv or .webm");
  }
  if (picture && !arguments.frames.empty()) {
    throw InputError("--frames: expected a video or a folder, or no --frames beside --at");
  }
  if (picture || VideoWriter::writes(arguments.out)) check_output({"OUT", arguments.out});
  const ImageSize size = parse_size(arguments.size);
  Scene scene = load_scene(arguments.scene);
  const take::FrameRange range = frames_of(arguments, scene);
  SceneRenderer renderer(std::move(scene), {.size = size,
                                            .view_dependent = arguments.view_dependent,
                                            .view_source = arguments.view_source});
  catch_interrupts();
  if (picture) {
    write_png(arguments.out, renderer.draw_at(*arguments.at_s).view());
  } else if (VideoWriter::writes(arguments.out)) {
    draw_video(renderer, arguments, range, size);
  } else {
    draw_folder(renderer, arguments, range);
  }
  return renderer.report_unfinished_takes();
}

int run_take(const Arguments& arguments) {
  if (!arguments.frames.empty()) {
    throw InputError("--frames: expected --scene; of a take --frame N is drawn");
  }
  if (arguments.camera.empty() == (arguments.turntable == 0)) {
    throw InputError("render: expected either --camera CAM or --turntable K");
  }
  if (arguments.out.extension() != ".png") {
    throw InputError(arguments.out.string() + ": expected a name that ends in .png");
  }
  check_output({"OUT", arguments.out});
  recorded::MeshFrames meshes = open_meshes(arguments.take, arguments.proxy);
  const int64_t frame = arguments.frame >= 0 ? arguments.frame : meshes.frames({}).front();
  meshes.enable_views(arguments.view_dependent);
  const recon::CompactFrame compact = meshes.read(frame);
  const FrameRenderer renderer(arguments, compact);
  const Image drawn = arguments.camera.empty() ? turntable(renderer, arguments.turntable, frame)
                                               : render_camera(arguments, renderer);
  write_png(arguments.out, drawn.view());
  return report_unfinished_meshes(meshes);
}

int run(Arguments arguments) {
  const bool of_take = arguments.scene.empty();
  if (!of_take && arguments.out.empty()) std::swap(arguments.take, arguments.out);
  if (arguments.out.empty() || arguments.take.empty() == of_take) {
    throw InputError(of_take
                         ? "render: expected TAKE and OUT.png, or --scene SCENE.json and OUT"
                         : "render: expected --scene SCENE.json and OUT; the scene has its takes");
  }
  return of_take ? run_take(arguments) : run_scene(arguments);
}

}  // namespace

void add_render(CommandLine& line) {
  cli::Command command =
      line.add("render", "Draw a reconstructed frame, or a scene, as pictures or a video",
               {"v3dctl render dancer --frame 12 --camera cam03 cam03.png",
                "v3dctl render dancer --frame 12 --turntable 8 round.png",
                "v3dctl render dancer --frame 12 --proxy --camera cam03 preview.png",
                "v3dctl render --scene duel/scene.json --at 2.5 duel.png",
                "v3dctl render --scene duel/scene.json --size 1920x1080 duel.mp4"});
  auto arguments = std::make_shared<Arguments>();
  command.add_option("TAKE", arguments->take,
                     "The folder of a reconstructed take; omitted with --scene");
  command.add_option("OUT", arguments->out,
                     "The picture (.png); of a scene also a video (.mp4, .mov, .mkv, .webm; by "
                     "ffmpeg) or a folder for 000000.png ...");
  cli::Option scene =
      command
          .add_option("--scene", arguments->scene,
                      "A scene file: takes, models and a camera path (docs/scene.md)")
          .type_name("SCENE.json");
  command.add_option("--at", arguments->at_s, "One picture, at this time of the scene")
      .type_name("SECONDS")
      .check(cli::number_in(0, 36'000))
      .needs(scene);
  command.add_option("--size", arguments->size, "Size of the pictures of a scene, in pixels")
      .type_name("WIDTHxHEIGHT")
      .show_default()
      .needs(scene);
  add_frames_option(command, arguments->frames);
  command.add_option("--frame", arguments->frame, "Pulse number of the frame (otherwise the first)")
      .type_name("N")
      .check(cli::non_negative_number())
      .excludes(scene);
  command.add_option("--camera", arguments->camera, "The view of this camera of the take")
      .type_name("CAM")
      .excludes(scene);
  command
      .add_option("--turntable", arguments->turntable,
                  "Views from K sides in one picture, with a floor")
      .type_name("K")
      .check(cli::integer_in(1, 64))
      .excludes(scene);
  const cli::Option view_dependent = command.add_flag(
      "--view-dependent", arguments->view_dependent,
      "View-dependent colours: images of cameras with a similar direction have the most "
      "weight");
  add_view_source_option(command, view_dependent, arguments->view_source);
  add_proxy_flag(command, arguments->proxy).excludes(scene);
  line.on_run(command, [arguments] { return run(*arguments); });
}

}  // namespace v3d::ctl
