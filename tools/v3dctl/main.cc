// v3dctl: the operator's and the offline worker's one tool.
#include "v3dctl/command_line.h"

int main(int argc, char** argv) {
  return v3d::ctl::run_program(argc, argv, v3d::ctl::add_all_commands);
}
