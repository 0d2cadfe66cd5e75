#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "base/config/calib_file.h"
#include "base/config/studio_file.h"
#include "base/core/error.h"
#include "base/image/image.h"
#include "calib/rig/rig_fit.h"
#include "calibrate/calibrate_commands.h"
#include "cli/command.h"
#include "common/console.h"
#include "v3dctl/options.h"

namespace v3d::calibrate {

cli::Command add_under(cli::Command calibrate, const std::string& name,
                       const std::string& description, const std::vector<std::string>& examples) {
  cli::Command command = calibrate.add_subcommand(name, description);
  command.accept_parent_options();
  std::string footer = examples.size() > 1 ? "Examples:" : "Example:";
  for (const std::string& example : examples) footer += "\n  $ " + example;
  command.footer(footer);
  return command;
}

void add_board_option(cli::Command command, std::string& board) {
  command
      .add_option("--board", board,
                  "chess:9x6:25mm (inner corners), or charuco:4x5:54mm:40.5mm:DICT_4X4_50 "
                  "(squares); append :inverted for a white-on-black print")
      .type_name("BOARD")
      .required();
}

void save_result(const std::filesystem::path& path, const Rig& rig) {
  ctl::stop_if_interrupted();
  save_calib(path, rig);
}

void add_calibrate(ctl::CommandLine& line) {
  cli::Command command = line.add(
      "calibrate", "Calibrate lenses, poses and colours of the cameras, and report weaknesses",
      {"v3dctl calibrate intrinsics --board chess:9x6:25mm --images 'cam01/*.png'",
       "v3dctl calibrate rig --board charuco:4x5:54mm:40.5mm:DICT_4X4_50 \\",
       "    --take boards-01 --out calib.toml"});
  command.require_subcommand();
  add_guess(line, command);
  add_intrinsics(line, command);
  add_rig(line, command);
  add_floor(line, command);
  add_refine(line, command);
  add_colour(line, command);
  add_convert(line, command);
}

namespace {

using Json = nlohmann::ordered_json;

struct Arguments {
  std::string size;
  double horizontal_fov_deg = 60;
  std::string out;
  bool json = false;
};

int run(const ctl::CommandLine& line, const Arguments& arguments) {
  const ImageSize size = parse_size(arguments.size);
  ctl::check_output({"--out", arguments.out});
  if (std::filesystem::exists(arguments.out)) {
    throw InputError(
        arguments.out +
        ": exists already and is not replaced by an uncalibrated rig; use another name, or "
        "move the file");
  }
  const Studio studio = line.studio();
  std::vector<std::string> names;
  for (const StudioCamera& camera : studio.cameras) names.push_back(camera.name);
  const Rig rig =
      calib::initial_rig(names, size, arguments.horizontal_fov_deg, studio.space.bounds);
  save_calib(arguments.out, rig);
  if (arguments.json) {
    std::printf("%s\n", Json{{"cameras", names}, {"out", arguments.out}}.dump(2).c_str());
    return kExitDone;
  }
  std::printf(
      "%s: %s with assumed poses on a ring around the space. Sufficient for recording boards, not "
      "for meshes; next step: v3dctl calibrate rig --live\n",
      arguments.out.c_str(), ctl::count_of(std::ssize(rig), "camera").c_str());
  return kExitDone;
}

}  // namespace

void add_guess(ctl::CommandLine& line, cli::Command calibrate) {
  cli::Command command = add_under(
      calibrate, "guess", "Write an initial calib.toml for a new studio, to record boards with",
      {"v3dctl calibrate guess --size 1024x768 --out /etc/v3d/calib.toml"});
  auto arguments = std::make_shared<Arguments>();
  command.add_option("--size", arguments->size, "Size of the images of all cameras")
      .type_name("WxH")
      .required();
  command
      .add_option("--across", arguments->horizontal_fov_deg,
                  "Horizontal field of view of the cameras, degrees")
      .type_name("DEG")
      .check(cli::number_in(5, 150))
      .show_default();
  command.add_option("--out", arguments->out, "The file to write; must not exist")
      .type_name("FILE")
      .required();
  ctl::add_json_flag(command, arguments->json);
  line.on_run(command, [&line, arguments] { return run(line, *arguments); });
}

}  // namespace v3d::calibrate
