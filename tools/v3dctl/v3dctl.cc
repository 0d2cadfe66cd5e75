// v3dctl: operates a studio and processes its takes.
#include "v3dctl/command_line.h"

namespace v3d::ctl {
namespace {

/// Adds all commands, in the order of the help text.
void add_all_commands(CommandLine& line) {
  add_operator_commands(line);
  add_check(line);
  add_preview(line);
  add_health(line);
  add_watch(line);
  add_key(line);
  add_node(line);
  add_doctor(line);
  add_update(line);
  add_takes(line);
  add_verify(line);
  add_external(line, "import", "Make a take from recordings of other sources");
  add_external(line, "plan", "Propose positions and lenses of cameras for a space");
  add_external(line, "calibrate", "Calibrate lenses, poses and colours of the cameras");
  add_reconstruct(line);
  add_camera_colours(line);
  add_performers(line);
  add_track(line);
  add_skeleton(line);
  add_edit(line);
  add_evaluate(line);
  add_export(line);
  add_render(line);
}

}  // namespace

}  // namespace v3d::ctl

int main(int argc, char** argv) {
  return v3d::ctl::run_program(argc, argv, v3d::ctl::add_all_commands);
}
