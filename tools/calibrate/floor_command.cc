#include <cstdio>
#include <nlohmann/json.hpp>
#include <string>

#include "base/config/calib_file.h"
#include "base/core/error.h"
#include "calib/rig/rig_alignment.h"
#include "calibrate/calibrate_commands.h"
#include "calibrate/rig_boards.h"
#include "common/console.h"

namespace v3d::calibrate {
namespace {

using Json = nlohmann::ordered_json;

struct Arguments {
  std::string board;
  std::string calib;
  RigArguments sources;
  std::string out;
  bool json = false;
};

Json to_json(const calib::FloorFit& fit) {
  Json cameras = Json::array();
  for (const int camera : fit.cameras) cameras.push_back(fit.rig[camera].name);
  return {{"rms_px", fit.rms_px},
          {"cameras", cameras},
          {"disagreement_deg", fit.disagreement_deg},
          {"board_by_rig", fit.board_by_rig},
          {"scaled", fit.scaled},
          {"weak", find_weaknesses(fit)}};
}

void print_text(const calib::FloorFit& fit) {
  std::printf("floor: %.2f px RMS in %s; ratio of board to rig lengths: %.4f%s\n", fit.rms_px,
              ctl::count_of(std::ssize(fit.cameras), "camera").c_str(), fit.board_by_rig,
              fit.scaled ? " (the rig was scaled)" : "");
  for (const std::string& weak : find_weaknesses(fit)) std::printf("weak: %s\n", weak.c_str());
}

int run(const ctl::CommandLine& line, const Arguments& arguments) {
  ctl::check_output({"--out", arguments.out});
  const calib::BoardDetector detector(calib::parse_board(arguments.board));
  const Rig rig = load_calib(arguments.calib);
  ctl::catch_interrupts();
  const auto cameras = find_floor_boards(arguments.sources.sources(line), rig, detector);
  const calib::FloorFit fit = fit_floor(rig, detector.board(), cameras);
  save_result(arguments.out, fit.rig);
  if (arguments.json) {
    std::printf("%s\n", to_json(fit).dump(2).c_str());
  } else {
    print_text(fit);
  }
  return kExitDone;
}

}  // namespace

void add_floor(ctl::CommandLine& line, cli::Command calibrate) {
  cli::Command command =
      add_under(calibrate, "floor", "Set origin, upward axis and scale by a board on the floor",
                {"v3dctl calibrate floor --calib calib.toml --board chess:8x6:115mm \\",
                 "    --take floor-01 --out calib.toml"});
  auto arguments = std::make_shared<Arguments>();
  add_board_option(command, arguments->board);
  command.add_option("--calib", arguments->calib, "The calibrated rig")
      .type_name("FILE")
      .required();
  arguments->sources.add_to(command);
  command.add_option("--out", arguments->out, "The rig in the world frame of the floor")
      .type_name("FILE")
      .required();
  ctl::add_json_flag(command, arguments->json);
  line.on_run(command, [&line, arguments] { return run(line, *arguments); });
}

}  // namespace v3d::calibrate
