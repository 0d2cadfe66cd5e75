// TOML with errors a person can act on: every message names file, line and field. The adapter of
// toml++.
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace v3d {

/// A table of a parsed file. Fields are asked for by name; a field that is missing or has another
/// type than asked for throws InputError ("studio.toml:12: camera.exposure_us: expected a number,
/// found a string"). refuse_unknown() then names any field that was never asked for, so that a
/// misspelt one is not ignored. Copies are cheap and keep the parsed file alive. One thread.
class TomlTable {
 public:
  static TomlTable load(const std::filesystem::path& path);
  /// `path` names the text in messages.
  static TomlTable parse(std::string_view text, const std::filesystem::path& path);

  bool has(std::string_view key) const;
  bool is_text(std::string_view key) const;
  /// Whether rows() may be asked: an array that begins with an array.
  bool is_rows(std::string_view key) const;

  std::string text(std::string_view key) const;
  std::string text_or(std::string_view key, std::string_view fallback) const;
  double number(std::string_view key) const;
  double number_or(std::string_view key, double fallback) const;
  int64_t integer(std::string_view key) const;
  int64_t integer_or(std::string_view key, int64_t fallback) const;
  bool boolean_or(std::string_view key, bool fallback) const;
  std::vector<double> numbers(std::string_view key) const;
  std::vector<int64_t> integers(std::string_view key) const;
  std::vector<std::string> texts(std::string_view key) const;
  /// An array of arrays of numbers.
  std::vector<std::vector<double>> rows(std::string_view key) const;

  TomlTable table(std::string_view key) const;
  /// [[key]]; empty when there is none.
  std::vector<TomlTable> tables(std::string_view key) const;
  /// All sub-tables with their keys, in the order of the file.
  std::vector<std::pair<std::string, TomlTable>> sub_tables() const;

  /// Throws InputError at the field: "file:line: field: message".
  [[noreturn]] void fail(std::string_view key, const std::string& message) const;
  /// The same for the table itself.
  [[noreturn]] void fail_here(const std::string& message) const;
  void refuse_unknown() const;

 private:
  struct Node;
  explicit TomlTable(std::shared_ptr<Node> node) : node_(std::move(node)) {}
  std::shared_ptr<Node>
      node_;  // shared: views into one parsed file, which lives as long as any of them
};

/// A number that reads back to the same bits ("0.1", "1e-09", "3.0").
std::string toml_number(double value);
/// A quoted and escaped string.
std::string toml_string(std::string_view text);

}  // namespace v3d
