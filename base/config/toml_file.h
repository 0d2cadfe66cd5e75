// TOML reader whose error messages contain file, line and field. The adapter of toml++.
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace v3d {

/// A table of a parsed file, whose fields are read by name.
/// A field that is missing or has another type throws InputError ("studio.toml:12:
/// camera.exposure_us: expected a number, found a string"). reject_unknown_fields() rejects fields
/// that were never read, so that a misspelt field is not ignored. Copies are cheap and keep the
/// parsed file alive. Use from one thread.
class TomlTable {
 public:
  static TomlTable load(const std::filesystem::path& path);
  /// Like load(), but reads `text`. Error messages use `path` as the file name.
  static TomlTable parse(std::string_view text, const std::filesystem::path& path);

  bool has(std::string_view key) const;
  bool is_text(std::string_view key) const;
  /// True for an array whose first element is an array, as rows() reads.
  bool is_array_of_arrays(std::string_view key) const;

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
  /// The tables [[key]]; empty when there is none.
  std::vector<TomlTable> tables(std::string_view key) const;
  /// All sub-tables with their keys, in the order of the file.
  std::vector<std::pair<std::string, TomlTable>> sub_tables() const;

  /// Throws InputError for a field: "file:line: field: message".
  [[noreturn]] void fail(std::string_view key, const std::string& message) const;
  /// Throws InputError for the table itself: "file:line: message".
  [[noreturn]] void fail_here(const std::string& message) const;
  /// Throws InputError for a field that was never read; the message lists the known fields.
  void reject_unknown_fields() const;

 private:
  struct Node;
  explicit TomlTable(std::shared_ptr<Node> node) : node_(std::move(node)) {}
  // Shared: all tables of a file keep its parsed content alive.
  std::shared_ptr<Node> node_;
};

/// The shortest text that reads back to the same bits ("0.1", "1e-09", "3.0").
std::string toml_number(double value);
/// A quoted and escaped TOML string.
std::string toml_string(std::string_view text);

}  // namespace v3d
