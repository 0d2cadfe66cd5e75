// v3dctl-import: the program of `v3dctl import`.
#include <cstdio>

#include "base/core/error.h"
#include "cli/command.h"
#include "common/console.h"
#include "v3dctl/command_line.h"
#include "v3dctl/import/import.h"

namespace v3d::ctl {
namespace {

struct Arguments {
  ImportOptions options;
  std::vector<std::string> videos;
  std::vector<std::string> backgrounds;
  std::string black;
  std::string frames;
};

void add_options(cli::Command command, Arguments& arguments) {
  ImportOptions& options = arguments.options;
  command
      .add_option("OUT_TAKE", options.take,
                  "The folder to create; its name is the name of the take")
      .required();
  command
      .add_option("--calib", options.calib,
                  "The calibrated cameras: calib.toml of aniposelib, Pose2Sim or caliscope")
      .type_name("FILE")
      .required();
  command.add_option("--images", options.images, "Images: DIR/CAM.png, or DIR/CAM/FRAME.png")
      .type_name("DIR");
  command
      .add_option("--masks", options.masks,
                  "Masks of the images under the same names, white on black")
      .type_name("DIR");
  command
      .add_option("--video", arguments.videos,
                  "The video of a camera; once for each camera, all of one length")
      .type_name("CAM=FILE");
  command
      .add_option(
          "--background", arguments.backgrounds,
          "The empty studio in the view of a camera: a video, a folder of images or an image")
      .type_name("CAM=FILE");
  command
      .add_option(
          "--background-black", arguments.black,
          "For a subject before black: foreground is brighter than LEVEL (0 to 1), dilated and "
          "then eroded by these radii in pixels")
      .type_name("LEVEL[:GROW:SHRINK]");
  command
      .add_option("--frames", arguments.frames,
                  "Only these images of each camera: A to B-1; they become pulses 0, 1, ...")
      .type_name("A:B");
  command
      .add_option("--rate", options.rate_hz,
                  "Images per second (otherwise the rate of the videos, otherwise 25)")
      .type_name("HZ")
      .check(cli::number_in(0.01, 100'000));
}

int run(Arguments arguments) {
  ImportOptions& options = arguments.options;
  options.videos = parse_camera_files(arguments.videos, "--video");
  options.backgrounds = parse_camera_files(arguments.backgrounds, "--background");
  if (!arguments.black.empty()) options.black = parse_black_background(arguments.black);
  options.frames = parse_frame_range(arguments.frames);
  catch_interrupts();
  const ImportResult result = import_take(options);
  std::printf("take %s: %s x %s, %g Hz\n", options.take.c_str(),
              count_of(std::ssize(result.cameras), "camera").c_str(),
              count_of(result.frames, "frame").c_str(), result.rate_hz);
  return kExitDone;
}

void add_import(CommandLine& line) {
  cli::Command command =
      line.add("import", "Make a take from recordings of other sources",
               {"v3dctl import dancer --calib calib.toml --images images --masks masks",
                "v3dctl import room --calib calib.toml --video cam1=1.avi cam2=2.avi \\",
                "    --background cam1=empty1.avi cam2=empty2.avi",
                "v3dctl import dino --calib calib.toml --images . --background-black 0.19:10:7"});
  auto arguments = std::make_shared<Arguments>();
  add_options(command, *arguments);
  line.on_run(command, [arguments] { return run(*arguments); });
}

}  // namespace
}  // namespace v3d::ctl

int main(int argc, char** argv) { return v3d::ctl::run_program(argc, argv, v3d::ctl::add_import); }
