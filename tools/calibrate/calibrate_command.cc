#include "calibrate/commands.h"

namespace v3d::calibrate {

CLI::App* add_under(CLI::App* calibrate, const std::string& name, const std::string& description,
                    const std::vector<std::string>& examples) {
  CLI::App* command = calibrate->add_subcommand(name, description);
  command->fallthrough();
  std::string footer = examples.size() > 1 ? "Examples:" : "Example:";
  for (const std::string& example : examples) footer += "\n  $ " + example;
  command->footer(footer);
  return command;
}

void add_board_option(CLI::App* command, std::string& board) {
  command
      ->add_option("--board", board,
                   "chess:9x6:25mm (inner corners), or charuco:4x5:54mm:40.5mm:DICT_4X4_50 "
                   "(squares); append :inverted for a white-on-black print")
      ->type_name("BOARD")
      ->required();
}

void add_calibrate(ctl::CommandLine& line) {
  CLI::App* command = line.add(
      "calibrate", "Calibrate lenses, poses and colours of the cameras, and report weaknesses",
      {"v3dctl calibrate intrinsics --board chess:9x6:25mm --images 'cam01/*.png'",
       "v3dctl calibrate rig --board charuco:4x5:54mm:40.5mm:DICT_4X4_50 \\",
       "    --take boards-01 --out calib.toml"});
  command->require_subcommand(1);
  add_guess(line, command);
  add_intrinsics(line, command);
  add_rig(line, command);
  add_floor(line, command);
  add_refine(line, command);
  add_colour(line, command);
  add_convert(line, command);
}

}  // namespace v3d::calibrate
