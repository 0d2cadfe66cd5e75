// v3d-sim: the simulated studio.
#include <exception>
#include <iostream>

#include "base/core/error.h"
#include "cli/command.h"
#include "cli/standard_output.h"
#include "v3d-sim/sim_commands.h"

namespace {

int run(int argc, char** argv) {
  int status = v3d::kExitDone;
  v3d::cli::Program app(
      "The simulated studio: a performer with known surface, and cameras that record it.",
      "v3d-sim");
  app.require_subcommand();
  app.add_version(V3D_VERSION);
  v3d::sim::add_take_command(app, status);
  v3d::sim::add_studio_command(app, status);
  v3d::sim::add_check_command(app, status);
  try {
    if (!app.parse(argc, argv)) return v3d::kExitDone;
  } catch (const v3d::cli::UsageError& error) {
    std::cerr << "v3d-sim: " << error.what() << "; see v3d-sim --help\n";
    return v3d::kExitBadInput;
  } catch (const v3d::InputError& error) {
    std::cerr << "v3d-sim: " << error.what() << '\n';
    return v3d::kExitBadInput;
  } catch (const std::exception& error) {
    std::cerr << "v3d-sim: " << error.what() << '\n';
    return v3d::kExitFailed;
  }
  return status;
}

}  // namespace

int main(int argc, char** argv) {
  return v3d::cli::finish_standard_output("v3d-sim", run(argc, argv));
}
