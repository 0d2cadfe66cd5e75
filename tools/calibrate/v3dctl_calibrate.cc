// v3dctl-calibrate: `v3dctl calibrate`, which hands over to it (v3dctl/command_line.cc).
#include "calibrate/calibrate_commands.h"

int main(int argc, char** argv) {
  return v3d::ctl::run_program(argc, argv, v3d::calibrate::add_calibrate);
}
