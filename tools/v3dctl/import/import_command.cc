#include <cstdio>

#include "base/error.h"
#include "common/number_option.h"
#include "v3dctl/command_line.h"
#include "v3dctl/import/import.h"
#include "v3dctl/process.h"

namespace v3d::ctl {
namespace {

struct Arguments {
  ImportOptions options;
  std::vector<std::string> videos;
  std::vector<std::string> backgrounds;
  std::string black;
  std::string frames;
};

void add_options(CLI::App* command, Arguments& arguments) {
  ImportOptions& options = arguments.options;
  command->add_option("OUT_TAKE", options.take, "The folder to make; its name is the take's")
      ->required();
  command
      ->add_option("--calib", options.calib,
                   "The cameras: calib.toml of aniposelib, Pose2Sim or caliscope")
      ->type_name("FILE")
      ->required();
  command->add_option("--images", options.images, "Pictures: DIR/CAM.png, or DIR/CAM/FRAME.png")
      ->type_name("DIR");
  command
      ->add_option("--masks", options.masks,
                   "Their silhouettes under the same names, white on black")
      ->type_name("DIR");
  command
      ->add_option("--video", arguments.videos,
                   "The video of a camera; once for each, all equally long")
      ->type_name("CAM=FILE");
  command
      ->add_option("--background", arguments.backgrounds,
                   "The empty studio as a camera sees it: a video, a folder of images or an image")
      ->type_name("CAM=FILE");
  command
      ->add_option("--background-black", arguments.black,
                   "The subject is on black: foreground is brighter than LEVEL (0 to 1), grown and "
                   "then shrunk by so many pixels")
      ->type_name("LEVEL[:GROW:SHRINK]");
  command
      ->add_option("--frames", arguments.frames,
                   "Only these pictures of each camera: A to B-1; they become pulses 0, 1, ...")
      ->type_name("A:B");
  command
      ->add_option("--rate", options.rate_hz,
                   "Pictures per second (else as the videos say, else 25)")
      ->type_name("HZ")
      ->check(number_in(0.01, 100'000));
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

}  // namespace

void add_import(CommandLine& line) {
  CLI::App* command =
      line.add("import", "Make a take of recordings that come from elsewhere",
               {"v3dctl import dancer --calib calib.toml --images images --masks masks",
                "v3dctl import room --calib calib.toml --video cam1=1.avi cam2=2.avi \\",
                "    --background cam1=empty1.avi cam2=empty2.avi",
                "v3dctl import dino --calib calib.toml --images . --background-black 0.19:10:7"});
  auto arguments = std::make_shared<Arguments>();
  add_options(command, *arguments);
  line.on_run(command, [arguments] { return run(*arguments); });
}

}  // namespace v3d::ctl
