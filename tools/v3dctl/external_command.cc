#include <stdexcept>

#include "base/error.h"
#include "base/io/process.h"
#include "v3dctl/command_line.h"

namespace v3d::ctl {
namespace {

namespace fs = std::filesystem;

fs::path find_program(const std::string& name) {
  const fs::path here = fs::read_symlink("/proc/self/exe").parent_path();
  for (const fs::path& folder : {here, here.parent_path() / "libexec/v3d"}) {
    if (fs::exists(folder / name)) return folder / name;
  }
  throw std::runtime_error(name +
                           " is not installed on this PC; it comes with the package v3d-import");
}

int hand_over(const std::string& name, const std::vector<std::string>& words) {
  const fs::path program = find_program("v3dctl-" + name);
  become_program(program, words);
  throw std::runtime_error(errno_message(program.string()));
}

}  // namespace

void add_external(CommandLine& line, const std::string& name, const std::string& description) {
  CLI::App* command = line.app().add_subcommand(name, description);
  command->set_help_flag();  // its help is the other program's
  command->prefix_command();
  line.on_run(command, [&line, name] { return hand_over(name, line.words()); });
}

}  // namespace v3d::ctl
