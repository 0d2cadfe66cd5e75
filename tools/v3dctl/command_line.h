// Command line of v3dctl: global options, subcommands, exit status.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/config/studio_file.h"
#include "cli/command.h"

namespace v3d::ctl {

/// The commands of v3dctl and their global options. The command that was parsed runs after the
/// parse. One thread.
class CommandLine {
 public:
  /// `program` must exist as long as this object. `words`: argv, the program's name first.
  CommandLine(cli::Command program, std::vector<std::string> words);

  cli::Command program() const { return program_; }
  /// Adds a command. Its help lists the `examples`, each after "  $ ".
  cli::Command add(const std::string& name, const std::string& description,
                   const std::vector<std::string>& examples);
  /// Sets the function of `command`. It returns the exit status and throws InputError for bad
  /// input.
  void on_run(cli::Command command, std::function<int()> run);
  /// Runs the command that was parsed. Requires a successful parse.
  int run() const { return run_(); }
  const std::vector<std::string>& words() const { return words_; }

  bool has_studio() const { return !find_studio().empty(); }
  /// --studio, otherwise $V3D_STUDIO, ./studio.toml or /etc/v3d/studio.toml. Throws InputError when
  /// there is none.
  std::filesystem::path studio_path() const;
  Studio studio() const { return load_studio(studio_path()); }
  /// Studio file with the defaults for work on a take: the one in the take, so that offline results
  /// equal the live ones, otherwise studio_path(); empty where neither exists.
  std::optional<Studio> studio_of_take(const std::filesystem::path& take) const;

 private:
  std::filesystem::path find_studio() const;

  cli::Command program_;
  std::string studio_option_;
  std::function<int()> run_;
  std::vector<std::string> words_;
};

/// Adds a command that another program implements: v3dctl-`name` in the folder of this program or
/// in ../libexec/v3d. The program replaces this process and gets the whole command line.
void add_external(CommandLine& line, const std::string& name, const std::string& description);

// Each adds one command or a group of related commands, and is defined in the file of that name.
void add_operator_commands(CommandLine& line);  ///< status arm start stop abort background
void add_check(CommandLine& line);
void add_preview(CommandLine& line);
void add_health(CommandLine& line);
void add_watch(CommandLine& line);
void add_key(CommandLine& line);
/// key authority, operator, enroll, revoke, members.
void add_member_commands(CommandLine& line, cli::Command key);
void add_node(CommandLine& line);
void add_doctor(CommandLine& line);
void add_update(CommandLine& line);
void add_takes(CommandLine& line);
void add_verify(CommandLine& line);
void add_reconstruct(CommandLine& line);  ///< and reconstruct-shards, which is not in the help
void add_camera_colours(CommandLine& line);
void add_performers(CommandLine& line);
void add_skeleton(CommandLine& line);
void add_edit(CommandLine& line);
void add_track(CommandLine& line);  ///< and track-shards, which is not in the help
void add_evaluate(CommandLine& line);
void add_export(CommandLine& line);
void add_render(CommandLine& line);

/// Parses and runs a command; returns the exit status of main(). Prints an error on stderr: bad
/// input is one line. Output that cannot be written is an error, too.
int run_program(int argc, char** argv, void (*add_commands)(CommandLine&));

}  // namespace v3d::ctl
