// Parser of command lines: a program, its subcommands, their options, and checks of option values.
//
// A facade of CLI11. No header of CLI11 is included here: each source that includes one compiles
// several seconds longer.
#pragma once

#include <concepts>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <initializer_list>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/core/error.h"

namespace CLI {
class App;
class Option;
}  // namespace CLI

namespace v3d::cli {

// Checks of option values.

/// Check of the value of an option, for Option::check().
struct Check {
  /// Returns an error message for `text`, a value as on the command line; empty: it is valid.
  std::function<std::string(const std::string& text)> error;
  std::string description;  ///< shown in the help after the type; may be empty
};

/// Accepts numbers from `low` to `high`, but not NaN.
Check number_in(double low, double high);
/// Accepts integers from `low` to `high`.
Check integer_in(int64_t low, int64_t high);
/// Accepts numbers above 0.
Check positive_number();
/// Accepts 0 and numbers above it.
Check non_negative_number();
/// Accepts exactly these values.
Check one_of(std::initializer_list<std::string_view> values);
Check one_of(std::initializer_list<int> values);

/// The number in `text`, parsed like an option of type double: "nan" and "inf" are numbers. Empty
/// for other text.
std::optional<double> number_of(const std::string& text);

// Commands and options.

/// An option, a positional argument or a flag of a command.
///
/// A handle: copies mean the same option. It is valid while its Program exists. Functions that
/// change the option return it, for the next call. One thread.
class Option {
 public:
  /// The option must be given.
  Option required(bool required = true);
  /// The name of the value in the help, such as FILE.
  Option type_name(const std::string& name);
  /// Rejects values with an error by `check`.
  Option check(Check check);
  /// Shows the present value of the variable in the help as the default.
  Option show_default();
  /// Omits the option from the help.
  Option hide();
  /// For lists: the option takes one word each time it is given, and no further words. The help
  /// shows one value, without "...".
  Option take_one_word();
  /// For lists: `separator` divides a word into several values.
  Option delimiter(char separator);
  /// This option can be given only together with `other`.
  Option needs(Option other);
  /// This option cannot be given together with `other`.
  Option excludes(Option other);
  /// True after a parse that found the option on the command line.
  bool is_given() const;

 private:
  friend class Command;
  explicit Option(CLI::Option* option) : option_(option) {}

  CLI::Option* option_;  ///< owned by the Program
};

/// Types of the variables of options.
template <typename T>
concept OptionValue = std::same_as<T, std::string> || std::same_as<T, std::filesystem::path> ||
    std::same_as<T, int> || std::same_as<T, uint32_t> || std::same_as<T, int64_t> ||
    std::same_as<T, uint64_t> || std::same_as<T, double> ||
    std::same_as<T, std::optional<double>> || std::same_as<T, std::vector<std::string>>;

/// A program or one of its subcommands.
///
/// A handle: copies mean the same command. It is valid while its Program exists. A malformed or
/// repeated name of an option or a subcommand is a bug; the functions that add one throw
/// std::runtime_error. One thread.
class Command {
 public:
  /// `description` is shown in the help.
  Command add_subcommand(const std::string& name, const std::string& description);
  /// Adds an option ("--out", "-o,--out"), a positional argument ("OUT") or both ("--out,OUT").
  /// The parse writes its value to `value`, which must exist until then; without the option it
  /// leaves `value` as it is.
  template <OptionValue T>
  Option add_option(const std::string& names, T& value, const std::string& description = {});
  /// Adds an option without a value. The parse sets `value` to true where it is given.
  Option add_flag(const std::string& names, bool& value, const std::string& description = {});

  /// Text below the help.
  void footer(const std::string& text);
  /// Options of the parent are accepted also after the words of this command.
  void accept_parent_options();
  /// Exactly one subcommand must be given.
  void require_subcommand();
  /// Omits the command from the help of its parent.
  void hide();
  /// Leaves all words after the name of this command unparsed, --help included.
  void parse_no_further();
  /// Program::parse() calls `action` at its end if this command was given without a subcommand, and
  /// throws what `action` throws.
  void on_parsed(std::function<void()> action);

 protected:
  explicit Command(CLI::App* app) : app_(app) {}
  CLI::App* app() const { return app_; }

 private:
  CLI::App* app_;  ///< owned by the Program
};

/// A command line that does not match the options of the program.
class UsageError : public InputError {
 public:
  using InputError::InputError;
};

/// The command line of a program, with the option --help. Its functions as a Command concern the
/// program itself. Owner of all commands and options. One thread.
class Program : public Command {
 public:
  /// `name` is shown in the help and in error lines; empty: the program's name in argv.
  explicit Program(const std::string& description, const std::string& name = {});
  ~Program();
  Program(const Program&) = delete;
  Program& operator=(const Program&) = delete;

  /// Adds --version, which prints `text`.
  void add_version(const std::string& text);
  /// Parses argv. Returns false if the command line asks for the help or the version, which are
  /// then on stdout. Throws UsageError with one line that does not name the program.
  bool parse(int argc, const char* const* argv);
  /// Like parse(), but prints errors on stderr. Returns the exit status when the program must end:
  /// 0 after the help or the version, another after an error.
  std::optional<int> parse_or_report(int argc, const char* const* argv);

 private:
  std::unique_ptr<CLI::App> owned_;
};

}  // namespace v3d::cli
