// TOML: a reader whose error messages contain file, line and field, and a writer. The adapter of
// toml++.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
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
  /// True for tables [[key]], as tables() reads.
  bool is_array_of_tables(std::string_view key) const;

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

  /// The names of all fields of the table with their values as text ("true", "4600", "0.5"), in the
  /// order of the file. A value must be a string, a finite number or a boolean.
  std::vector<std::pair<std::string, std::string>> values() const;

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

/// Writes TOML in the order of the calls, one line for each field. Strings are escaped; numbers
/// read back to the same bits. Keys and names of tables are bare: letters, digits, '_' and '-'. Use
/// from one thread.
class TomlWriter {
 public:
  /// A line "# text".
  TomlWriter& comment(std::string_view text);
  /// Starts the table [name], after an empty line.
  TomlWriter& table(std::string_view name);
  /// Starts the next table of the array [[name]], after an empty line.
  TomlWriter& element(std::string_view name);

  // Fields. `note` becomes a comment at the end of the line.
  TomlWriter& text(std::string_view key, std::string_view value, std::string_view note = {});
  TomlWriter& number(std::string_view key, double value);
  TomlWriter& integer(std::string_view key, int64_t value, std::string_view note = {});
  TomlWriter& boolean(std::string_view key, bool value);
  TomlWriter& numbers(std::string_view key, std::span<const double> values);
  TomlWriter& integers(std::string_view key, std::span<const int64_t> values);
  TomlWriter& texts(std::string_view key, std::span<const std::string> values);
  /// An array of arrays of numbers.
  TomlWriter& rows(std::string_view key, std::span<const std::vector<double>> rows);

  /// The text so far.
  const std::string& written() const { return written_; }

 private:
  TomlWriter& field(std::string_view key, std::string_view value, std::string_view note = {});
  std::string written_;
};

/// The shortest text that reads back to the same bits ("0.1", "1e-09", "3.0").
std::string toml_number(double value);

}  // namespace v3d
