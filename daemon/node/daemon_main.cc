#include "daemon/node/daemon_main.h"

#include <malloc.h>
#include <spdlog/spdlog.h>

#include <CLI/CLI.hpp>

#include "base/core/error.h"
#include "daemon/node/service.h"

namespace v3d {

namespace {

/// Images are allocated and freed hundreds of times per second. By default malloc would return the
/// memory of each to the kernel and fault it in again, page by page. Keep up to 256 MiB instead.
void keep_freed_memory() {
  constexpr int kLargestKept = 32 << 20;
  constexpr int kKept = 256 << 20;
  mallopt(M_MMAP_THRESHOLD, kLargestKept);
  mallopt(M_TRIM_THRESHOLD, kKept);
}

}  // namespace

int daemon_main(int argc, char** argv, const DaemonProgram& program, const DaemonFunction& run) {
  CLI::App app{program.purpose, program.name};
  std::filesystem::path studio;
  std::string node;
  std::string log_level = "info";
  app.set_version_flag("--version", V3D_VERSION);
  app.add_option("--studio", studio, "the studio file")->required()->type_name("studio.toml");
  if (program.is_a_node) {
    app.add_option("--node", node, "the [[node]] of the studio file that this process is")
        ->required(program.node_is_required)
        ->type_name("NAME");
  }
  app.add_option("--log-level", log_level, "trace, debug, info, warning, error or off")
      ->capture_default_str();
  bool one_shot = false;
  if (program.one_shot) app.add_flag(program.one_shot->flag, one_shot, program.one_shot->purpose);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? kExitDone : kExitBadInput;
  }
  keep_freed_memory();
  try {
    start_logging(program.name, log_level);
    if (one_shot) {
      program.one_shot->run(load_studio(studio), node);
      return kExitDone;
    }
    catch_stop_signals();
    run(load_studio(studio), node);
    return kExitDone;
  } catch (const InputError& error) {
    spdlog::critical("{}", error.what());
    return kExitBadInput;
  } catch (const std::exception& error) {
    spdlog::critical("{}", error.what());
    return kExitFailed;
  }
}

}  // namespace v3d
