// v3dctl: the operator's and the offline worker's one tool.
#include <cstdio>
#include <exception>
#include <string>

#include "base/error.h"
#include "v3dctl/command.h"

namespace {

int parse_and_run(int argc, char** argv) {
  CLI::App app("Record people as 3D video: operate the studio, and work on what it recorded.",
               "v3dctl");
  app.set_version_flag("--version", "v3dctl " V3D_VERSION);
  v3d::ctl::CommandLine line(app);
  v3d::ctl::add_all_commands(line);
  try {
    app.parse(argc, argv);
  } catch (const CLI::Success& help_or_version) {
    return app.exit(help_or_version);
  } catch (const CLI::ParseError& error) {
    throw v3d::InputError(std::string(error.what()) + " (see v3dctl --help)");
  }
  return line.run();
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return parse_and_run(argc, argv);
  } catch (const v3d::InputError& error) {
    std::fprintf(stderr, "v3dctl: %s\n", error.what());
    return v3d::kExitBadInput;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "v3dctl: %s\n", error.what());
    return v3d::kExitFailed;
  }
}
