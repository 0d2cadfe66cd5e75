#include "cli/command.h"

#include <CLI/CLI.hpp>
#include <cmath>
#include <utility>

#include "cli/standard_output.h"

namespace v3d::cli {

namespace {

Check check_of(const CLI::Validator& validator) {
  return {[validator](const std::string& text) -> std::string {
            try {
              return validator(text);
            } catch (const CLI::ValidationError& error) {
              return error.what();
            }
          },
          validator.get_description()};
}

}  // namespace

std::optional<double> number_of(const std::string& text) {
  double number = 0;
  if (!CLI::detail::lexical_cast(text, number)) return std::nullopt;
  return number;
}

namespace {

/// A check of finite numbers. CLI::Range also accepts NaN, and prints limits with up to 309 digits.
Check check_of_numbers(const std::string& expected, const std::string& description,
                       const std::function<bool(double)>& is_good) {
  const auto error = [=](const std::string& text) {
    const std::optional<double> number = number_of(text);
    const bool good = number && std::isfinite(*number) && is_good(*number);
    return good ? std::string() : "expected " + expected + ", found '" + text + "'";
  };
  return {error, description};
}

}  // namespace

Check number_in(double low, double high) {
  const auto text_of = [](double number) { return CLI::detail::to_string(number); };
  return check_of_numbers("a number from " + text_of(low) + " to " + text_of(high),
                          "FLOAT in [" + text_of(low) + " - " + text_of(high) + "]",
                          [=](double number) { return number >= low && number <= high; });
}

Check integer_in(int64_t low, int64_t high) { return check_of(CLI::Range(low, high)); }

Check positive_number() {
  return check_of_numbers("a number above 0", CLI::PositiveNumber.get_description(),
                          [](double number) { return number > 0; });
}

Check non_negative_number() {
  return check_of_numbers("0 or a number above 0", CLI::NonNegativeNumber.get_description(),
                          [](double number) { return number >= 0; });
}

Check one_of(std::initializer_list<std::string_view> values) {
  return check_of(CLI::IsMember(std::vector<std::string>(values.begin(), values.end())));
}

Check one_of(std::initializer_list<int> values) { return check_of(CLI::IsMember(values)); }

Option Option::required(bool required) {
  option_->required(required);
  return *this;
}

Option Option::type_name(const std::string& name) {
  option_->type_name(name);
  return *this;
}

Option Option::check(Check check) {
  option_->check(std::move(check.error), std::move(check.description));
  return *this;
}

Option Option::show_default() {
  option_->capture_default_str();
  return *this;
}

Option Option::hide() {
  option_->group("");
  return *this;
}

Option Option::take_one_word() {
  option_->expected(1)->allow_extra_args(false);
  option_->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  return *this;
}

Option Option::delimiter(char separator) {
  option_->delimiter(separator);
  return *this;
}

Option Option::needs(Option other) {
  option_->needs(other.option_);
  return *this;
}

Option Option::excludes(Option other) {
  option_->excludes(other.option_);
  return *this;
}

bool Option::is_given() const { return option_->count() > 0; }

Command Command::add_subcommand(const std::string& name, const std::string& description) {
  return Command(app_->add_subcommand(name, description));
}

template <OptionValue T>
Option Command::add_option(const std::string& names, T& value, const std::string& description) {
  return Option(app_->add_option(names, value, description));
}

template Option Command::add_option(const std::string&, std::string&, const std::string&);
template Option Command::add_option(const std::string&, std::filesystem::path&, const std::string&);
template Option Command::add_option(const std::string&, int&, const std::string&);
template Option Command::add_option(const std::string&, uint32_t&, const std::string&);
template Option Command::add_option(const std::string&, int64_t&, const std::string&);
template Option Command::add_option(const std::string&, uint64_t&, const std::string&);
template Option Command::add_option(const std::string&, double&, const std::string&);
template Option Command::add_option(const std::string&, std::optional<double>&, const std::string&);
template Option Command::add_option(const std::string&, std::vector<std::string>&,
                                    const std::string&);

Option Command::add_flag(const std::string& names, bool& value, const std::string& description) {
  return Option(app_->add_flag(names, value, description));
}

void Command::footer(const std::string& text) { app_->footer(text); }
void Command::accept_parent_options() { app_->fallthrough(); }
void Command::require_subcommand() { app_->require_subcommand(1); }
void Command::hide() { app_->group(""); }

void Command::parse_no_further() {
  app_->set_help_flag();
  app_->prefix_command();
}

void Command::on_parsed(std::function<void()> action) {
  // CLI11 calls the callback of a command also when one of its subcommands was parsed.
  app_->callback([app = app_, action = std::move(action)] {
    if (app->get_subcommands().empty()) action();
  });
}

Program::Program(const std::string& description, const std::string& name)
    : Command(new CLI::App(description, name)), owned_(app()) {}

Program::~Program() = default;

void Program::add_version(const std::string& text) { app()->set_version_flag("--version", text); }

bool Program::parse(int argc, const char* const* argv) {
  try {
    app()->parse(argc, argv);
    return true;
  } catch (const CLI::Success& help_or_version) {
    app()->exit(help_or_version);
    return false;
  } catch (const CLI::ParseError& error) {
    throw UsageError(error.what());
  }
}

std::optional<int> Program::parse_or_report(int argc, const char* const* argv) {
  try {
    app()->parse(argc, argv);
    return std::nullopt;
  } catch (const CLI::ParseError& error) {
    return finish_standard_output(app()->get_name(), app()->exit(error));
  }
}

}  // namespace v3d::cli
