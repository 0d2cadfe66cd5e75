#include "v3dctl/command_line.h"

#include <cstdio>
#include <cstdlib>
#include <exception>
#include <stdexcept>
#include <utility>

#include "base/core/error.h"
#include "base/core/text.h"
#include "base/io/process.h"
#include "cli/standard_output.h"
#include "take/take.h"

namespace v3d::ctl {

CommandLine::CommandLine(cli::Command program, std::vector<std::string> words)
    : program_(program), words_(std::move(words)) {
  program_.require_subcommand();
  program_
      .add_option("--studio", studio_option_,
                  "The studio file (otherwise $V3D_STUDIO, ./studio.toml, /etc/v3d/studio.toml)")
      .type_name("FILE");
}

cli::Command CommandLine::add(const std::string& name, const std::string& description,
                              const std::vector<std::string>& examples) {
  cli::Command command = program_.add_subcommand(name, description);
  command.accept_parent_options();
  std::string footer = examples.size() > 1 ? "Examples:" : "Example:";
  for (const std::string& example : examples) footer += "\n  $ " + example;
  command.footer(footer);
  return command;
}

void CommandLine::on_run(cli::Command command, std::function<int()> run) {
  command.on_parsed([this, run = std::move(run)] { run_ = run; });
}

/// Returns an empty path when there is none.
std::filesystem::path CommandLine::find_studio() const {
  if (!studio_option_.empty()) return studio_option_;
  if (const char* variable = std::getenv("V3D_STUDIO"); variable && *variable) return variable;
  for (const char* place : {"studio.toml", "/etc/v3d/studio.toml"}) {
    if (std::filesystem::exists(place)) return place;
  }
  return {};
}

std::filesystem::path CommandLine::studio_path() const {
  std::filesystem::path path = find_studio();
  if (!path.empty()) return path;
  throw InputError(
      "no studio file: expected --studio FILE, V3D_STUDIO, ./studio.toml or "
      "/etc/v3d/studio.toml");
}

std::optional<Studio> CommandLine::studio_of_take(const std::filesystem::path& take) const {
  if (auto studio = take::load_take_studio({take})) return studio;
  std::filesystem::path path;
  try {
    path = studio_path();
  } catch (const InputError&) {
    return std::nullopt;
  }
  return load_studio(path);
}

namespace {

namespace fs = std::filesystem;

fs::path find_program(const std::string& name) {
  const fs::path here = fs::read_symlink("/proc/self/exe").parent_path();
  for (const fs::path& folder : {here, here.parent_path() / "libexec/v3d"}) {
    if (fs::exists(folder / name)) return folder / name;
  }
  throw std::runtime_error(name + " is not installed on this PC; it is in the package v3d-import");
}

int run_external(const std::string& name, const std::vector<std::string>& words) {
  const fs::path program = find_program("v3dctl-" + name);
  exec_program(program, words);
  throw std::runtime_error(errno_message(program.string()));
}

int parse_and_run(int argc, char** argv, void (*add_commands)(CommandLine&)) {
  cli::Program program("Record people as 3D video: operate the studio and process its takes.",
                       "v3dctl");
  program.add_version("v3dctl " V3D_VERSION);
  CommandLine line(program, {argv, argv + argc});
  add_commands(line);
  try {
    if (!program.parse(argc, argv)) return kExitDone;
  } catch (const cli::UsageError& error) {
    throw InputError(std::string(error.what()) + " (see v3dctl --help)");
  }
  return line.run();
}

/// Runs the command and reports its error.
int status_of_run(int argc, char** argv, void (*add_commands)(CommandLine&)) {
  try {
    return parse_and_run(argc, argv, add_commands);
  } catch (const InputError& error) {
    std::fprintf(stderr, "v3dctl: %s\n", printable(error.what()).c_str());
    return kExitBadInput;
  } catch (const std::exception& error) {  // may have a line for each node
    std::fprintf(stderr, "v3dctl: %s\n", printable_text(error.what()).c_str());
    return kExitFailed;
  }
}

}  // namespace

void add_external(CommandLine& line, const std::string& name, const std::string& description) {
  cli::Command command = line.program().add_subcommand(name, description);
  command.parse_no_further();  // the other program prints the help
  line.on_run(command, [&line, name] { return run_external(name, line.words()); });
}

int run_program(int argc, char** argv, void (*add_commands)(CommandLine&)) {
  return cli::finish_standard_output("v3dctl", status_of_run(argc, argv, add_commands));
}

}  // namespace v3d::ctl
