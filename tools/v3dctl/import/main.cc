// v3dctl-import: `v3dctl import`, which hands over to it (external_command.cc).
#include "v3dctl/command_line.h"

int main(int argc, char** argv) { return v3d::ctl::run_program(argc, argv, v3d::ctl::add_import); }
