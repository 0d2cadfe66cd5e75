#include <optional>

#include "base/calib_file.h"
#include "base/error.h"
#include "base/png_file.h"
#include "recon/renderer.h"
#include "v3dctl/command.h"
#include "v3dctl/mesh_frames.h"
#include "v3dctl/take_frames.h"
#include "v3dctl/view_colours.h"

namespace v3d::ctl {
namespace {

constexpr ImageSize kTurntableView{480, 560};

struct Arguments {
  std::filesystem::path take;
  std::filesystem::path out;
  int64_t frame = 0;
  std::string camera;
  int turntable = 0;
  bool view_dependent = false;
};

/// The mesh with the colours that a camera is to see.
class Painter {
 public:
  Painter(const Arguments& arguments, CompactFrame frame) : mesh_(std::move(frame.mesh)) {
    if (arguments.view_dependent) colours_.emplace(arguments.take, frame);
  }
  const Mesh& mesh() const { return mesh_; }
  Image draw(const CameraModel& eye, const DrawOptions& options) const {
    return draw_mesh(colours_ ? colours_->seen_by(eye, mesh_) : mesh_, eye, options);
  }

 private:
  Mesh mesh_;
  std::optional<ViewColours> colours_;
};

Image through_camera(const Arguments& arguments, const Painter& painter) {
  const TakePaths paths{arguments.take};
  const Rig rig = load_calib(paths.calib());
  const int index = find_camera(rig, arguments.camera);
  if (index < 0) {
    std::vector<std::string> names;
    for (const RigCamera& camera : rig) names.push_back(camera.name);
    throw InputError("--camera " + arguments.camera + ": not in " + paths.calib().string() +
                     ", which has " + join_names(names));
  }
  return painter.draw(rig[static_cast<size_t>(index)].model, {});
}

// A floor for people and what is as large; its grid would hide anything much smaller.
std::optional<FloorOptions> floor_under(const Box& bounds) {
  if (bounds.size().maxCoeff() < 0.5) return std::nullopt;
  FloorOptions floor;
  floor.z = bounds.min.z();
  return floor;
}

Image turntable(const Painter& painter, int views, int64_t frame) {
  if (painter.mesh().vertices.empty()) {
    throw InputError("--turntable: frame " + std::to_string(frame) +
                     " is empty: nothing to walk round");
  }
  const Box bounds = bounds_of(painter.mesh());
  DrawOptions options;
  options.head_light = 0.3;
  options.floor = floor_under(bounds);
  std::vector<Image> images;
  for (const CameraModel& camera : turntable_cameras(bounds, views, kTurntableView)) {
    images.push_back(painter.draw(camera, options));
  }
  return contact_sheet(images);
}

int run(const Arguments& arguments) {
  if (arguments.camera.empty() == (arguments.turntable == 0)) {
    throw InputError("render: give either --camera CAM or --turntable K");
  }
  if (arguments.out.extension() != ".png") {
    throw InputError(arguments.out.string() + ": want a name that ends in .png");
  }
  const Painter painter(arguments, MeshFrames(arguments.take).read(arguments.frame));
  write_png(arguments.out,
            (arguments.camera.empty() ? turntable(painter, arguments.turntable, arguments.frame)
                                      : through_camera(arguments, painter))
                .view());
  return kExitDone;
}

}  // namespace

void add_render(CommandLine& line) {
  CLI::App* command = line.add("render", "Draw a reconstructed frame as a PNG picture",
                               {"v3dctl render dancer --frame 12 --camera cam03 cam03.png",
                                "v3dctl render dancer --frame 12 --turntable 8 round.png"});
  auto arguments = std::make_shared<Arguments>();
  command->add_option("TAKE", arguments->take, "The folder of a reconstructed take")->required();
  command->add_option("OUT.png", arguments->out, "The picture")->required();
  command->add_option("--frame", arguments->frame, "The frame, by its pulse number")
      ->type_name("N")
      ->required()
      ->check(CLI::NonNegativeNumber);
  command->add_option("--camera", arguments->camera, "As this camera of the take sees it")
      ->type_name("CAM");
  command->add_option("--turntable", arguments->turntable, "From K sides, side by side, on a floor")
      ->type_name("K")
      ->check(CLI::Range(1, 64));
  command->add_flag("--view-dependent", arguments->view_dependent,
                    "Colours for this viewpoint: pictures of cameras that look the same way count "
                    "most");
  line.on_run(command, [arguments] { return run(*arguments); });
}

}  // namespace v3d::ctl
