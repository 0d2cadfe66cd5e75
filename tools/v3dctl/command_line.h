// The command line of v3dctl: one function per command adds it to the parser; the one that the user
// named is run after parsing, outside the parser, so that its errors are its own.
#pragma once

#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/studio_file.h"

namespace v3d::ctl {

class CommandLine {
 public:
  CommandLine(CLI::App& app, std::vector<std::string> words);

  CLI::App& app() { return app_; }
  /// Adds a command. `example` lines are shown under its help, each after "  $ ".
  CLI::App* add(const std::string& name, const std::string& description,
                const std::vector<std::string>& examples);
  /// What to do when `command` was given; the result is the exit status. Bad input: InputError.
  void on_run(CLI::App* command, std::function<int()> run);
  int run() const { return run_(); }
  /// What was typed, the program's name first.
  const std::vector<std::string>& words() const { return words_; }

  bool has_studio() const { return !find_studio().empty(); }
  /// --studio, else $V3D_STUDIO, else ./studio.toml, else /etc/v3d/studio.toml. Throws InputError
  /// when there is none.
  std::filesystem::path studio_path() const;
  Studio studio() const { return load_studio(studio_path()); }
  /// The studio file that gives defaults for work on a take: the take's own, so that results are
  /// those of the live reconstruction, else the one of this place. A take needs none.
  std::optional<Studio> studio_of_take(const std::filesystem::path& take) const;

 private:
  std::filesystem::path find_studio() const;

  CLI::App& app_;
  std::string studio_option_;
  std::function<int()> run_;
  std::vector<std::string> words_;
};

/// A command that is a program of its own, v3dctl-NAME: found beside this program or in
/// ../libexec/v3d. It is given the whole command line.
void add_external(CommandLine& line, const std::string& name, const std::string& description);

void add_import(CommandLine& line);  ///< only in v3dctl-import
void add_reconstruct(CommandLine& line);
void add_reconstruct_pieces(CommandLine& line);  ///< hidden: what the one above begins
void add_verify(CommandLine& line);
void add_takes(CommandLine& line);
void add_evaluate(CommandLine& line);
void add_export(CommandLine& line);
void add_render(CommandLine& line);
void add_operator_commands(CommandLine& line);  ///< status arm start stop abort background
void add_check(CommandLine& line);
void add_preview(CommandLine& line);
void add_health(CommandLine& line);
void add_watch(CommandLine& line);
void add_key(CommandLine& line);
void add_doctor(CommandLine& line);

/// All of them, in the order of the help text.
void add_all_commands(CommandLine& line);

/// The whole of main(): parses, runs, and says in one line what was wrong.
int run_program(int argc, char** argv, void (*add_commands)(CommandLine&));

}  // namespace v3d::ctl
