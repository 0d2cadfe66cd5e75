// v3dctl-plan: `v3dctl plan`, which hands over to it (v3dctl/command_line.cc).
#include "plan/plan_command.h"

int main(int argc, char** argv) { return v3d::ctl::run_program(argc, argv, v3d::plan::add_plan); }
