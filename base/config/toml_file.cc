#include "base/config/toml_file.h"

#include <toml++/toml.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <set>
#include <sstream>

#include "base/core/error.h"
#include "base/io/file.h"

namespace v3d {

struct TomlTable::Node {
  std::shared_ptr<const toml::table> root;
  const toml::table* table = nullptr;
  std::string path;    // of the file
  std::string prefix;  // "camera." before the names of fields in messages
  mutable std::set<std::string, std::less<>> read_keys;

  const toml::node* find(std::string_view key) const {
    read_keys.emplace(key);
    return table->get(key);
  }

  [[noreturn]] void fail(const toml::source_region& where, const std::string& message) const {
    const std::string line =
        where.begin ? ":" + std::to_string(static_cast<unsigned>(where.begin.line)) : "";
    throw InputError(path + line + ": " + message);
  }

  const toml::node& require(std::string_view key) const {
    const toml::node* node = find(key);
    if (node == nullptr) {
      fail(table->source(), prefix + std::string(key) + ": missing");
    }
    return *node;
  }

  [[noreturn]] void fail_type(std::string_view key, const toml::node& node,
                              std::string_view expected) const {
    std::ostringstream found;
    found << node.type();
    fail(node.source(), prefix + std::string(key) + ": expected " + std::string(expected) +
                            ", found " + found.str());
  }

  /// A finite number; integers count as numbers.
  double number_of(std::string_view key, const toml::node& node) const {
    const auto value = node.is_number() ? node.value<double>() : std::nullopt;
    if (!value || !std::isfinite(*value)) {
      fail_type(key, node, "a finite number");
    }
    return *value;
  }

  const toml::array& array_of(std::string_view key, const toml::node& node,
                              std::string_view expected) const {
    if (!node.is_array()) {
      fail_type(key, node, expected);
    }
    return *node.as_array();
  }

  std::vector<double> numbers_of(std::string_view key, const toml::node& node) const {
    std::vector<double> values;
    for (const toml::node& element : array_of(key, node, "an array of numbers")) {
      values.push_back(number_of(key, element));
    }
    return values;
  }
};

TomlTable TomlTable::load(const std::filesystem::path& path) {
  return parse(io::value_or_throw(io::read_file(path, kMaxTakeTextBytes)), path);
}

TomlTable TomlTable::parse(std::string_view text, const std::filesystem::path& path) {
  auto node = std::make_shared<Node>();
  node->path = path.string();
  try {
    node->root = std::make_shared<const toml::table>(toml::parse(text, path.string()));
  } catch (const toml::parse_error& error) {
    std::string message(error.description());
    std::replace(message.begin(), message.end(), '\n', ' ');
    node->fail(error.source(), message);
  }
  node->table = node->root.get();
  return TomlTable(std::move(node));
}

bool TomlTable::has(std::string_view key) const { return node_->find(key) != nullptr; }

bool TomlTable::is_text(std::string_view key) const {
  const toml::node* node = node_->find(key);
  return node != nullptr && node->is_string();
}

bool TomlTable::is_array_of_arrays(std::string_view key) const {
  const toml::node* node = node_->find(key);
  const toml::array* array = node != nullptr ? node->as_array() : nullptr;
  return array != nullptr && !array->empty() && array->front().is_array();
}

bool TomlTable::is_array_of_tables(std::string_view key) const {
  const toml::node* node = node_->find(key);
  return node != nullptr && node->is_array_of_tables();
}

std::string TomlTable::text(std::string_view key) const {
  const toml::node& node = node_->require(key);
  if (!node.is_string()) {
    node_->fail_type(key, node, "a string");
  }
  return node.as_string()->get();
}

std::string TomlTable::text_or(std::string_view key, std::string_view fallback) const {
  return has(key) ? text(key) : std::string(fallback);
}

double TomlTable::number(std::string_view key) const {
  return node_->number_of(key, node_->require(key));
}

double TomlTable::number_or(std::string_view key, double fallback) const {
  return has(key) ? number(key) : fallback;
}

int64_t TomlTable::integer(std::string_view key) const {
  const toml::node& node = node_->require(key);
  if (!node.is_integer()) {
    node_->fail_type(key, node, "a whole number");
  }
  return node.as_integer()->get();
}

int64_t TomlTable::integer_or(std::string_view key, int64_t fallback) const {
  return has(key) ? integer(key) : fallback;
}

bool TomlTable::boolean_or(std::string_view key, bool fallback) const {
  const toml::node* node = node_->find(key);
  if (node == nullptr) {
    return fallback;
  }
  if (!node->is_boolean()) {
    node_->fail_type(key, *node, "true or false");
  }
  return node->as_boolean()->get();
}

std::vector<double> TomlTable::numbers(std::string_view key) const {
  return node_->numbers_of(key, node_->require(key));
}

std::vector<int64_t> TomlTable::integers(std::string_view key) const {
  std::vector<int64_t> values;
  for (const toml::node& element :
       node_->array_of(key, node_->require(key), "an array of whole numbers")) {
    if (!element.is_integer()) {
      node_->fail_type(key, element, "a whole number");
    }
    values.push_back(element.as_integer()->get());
  }
  return values;
}

std::vector<std::string> TomlTable::texts(std::string_view key) const {
  std::vector<std::string> values;
  for (const toml::node& element :
       node_->array_of(key, node_->require(key), "an array of strings")) {
    if (!element.is_string()) {
      node_->fail_type(key, element, "a string");
    }
    values.push_back(element.as_string()->get());
  }
  return values;
}

std::vector<std::vector<double>> TomlTable::rows(std::string_view key) const {
  std::vector<std::vector<double>> values;
  for (const toml::node& row : node_->array_of(key, node_->require(key), "an array of rows")) {
    values.push_back(node_->numbers_of(key, row));
  }
  return values;
}

TomlTable TomlTable::table(std::string_view key) const {
  const toml::node& node = node_->require(key);
  if (!node.is_table()) {
    node_->fail_type(key, node, "a table");
  }
  auto inner = std::make_shared<Node>(*node_);
  inner->table = node.as_table();
  inner->prefix = node_->prefix + std::string(key) + ".";
  inner->read_keys.clear();
  return TomlTable(std::move(inner));
}

std::vector<TomlTable> TomlTable::tables(std::string_view key) const {
  std::vector<TomlTable> result;
  if (!has(key)) {
    return result;
  }
  const std::string expected = "[[" + std::string(key) + "]] tables";
  for (const toml::node& element : node_->array_of(key, node_->require(key), expected)) {
    if (!element.is_table()) {
      node_->fail_type(key, element, expected);
    }
    auto inner = std::make_shared<Node>(*node_);
    inner->table = element.as_table();
    inner->prefix = node_->prefix + std::string(key) + ".";
    inner->read_keys.clear();
    result.push_back(TomlTable(std::move(inner)));
  }
  return result;
}

std::vector<std::pair<std::string, TomlTable>> TomlTable::sub_tables() const {
  std::vector<std::pair<std::string, TomlTable>> result;
  for (const auto& [key, value] : *node_->table) {
    if (value.is_table()) {
      result.emplace_back(key.str(), table(key.str()));
    }
  }
  // toml++ sorts keys; restore the order of the file.
  std::stable_sort(result.begin(), result.end(), [](const auto& a, const auto& b) {
    return a.second.node_->table->source().begin < b.second.node_->table->source().begin;
  });
  return result;
}

std::vector<std::pair<std::string, std::string>> TomlTable::values() const {
  std::vector<std::pair<toml::source_position, std::pair<std::string, std::string>>> found;
  for (const auto& [key, value] : *node_->table) {
    const std::string name(key.str());
    std::string text;
    if (value.is_boolean()) {
      text = *value.value<bool>() ? "true" : "false";
    } else if (value.is_integer()) {
      text = std::to_string(*value.value<int64_t>());
    } else if (value.is_floating_point()) {
      text = toml_number(number(name));
    } else {
      text = this->text(name);
    }
    node_->read_keys.insert(name);
    found.push_back({key.source().begin, {name, std::move(text)}});
  }
  std::stable_sort(found.begin(), found.end(),
                   [](const auto& a, const auto& b) { return a.first < b.first; });
  std::vector<std::pair<std::string, std::string>> result;
  for (auto& entry : found) result.push_back(std::move(entry.second));
  return result;
}

void TomlTable::fail(std::string_view key, const std::string& message) const {
  const toml::node* node = node_->find(key);
  node_->fail(node != nullptr ? node->source() : node_->table->source(),
              node_->prefix + std::string(key) + ": " + message);
}

void TomlTable::fail_here(const std::string& message) const {
  node_->fail(node_->table->source(), message);
}

void TomlTable::reject_unknown_fields() const {
  for (const auto& [key, value] : *node_->table) {
    if (node_->read_keys.find(key.str()) == node_->read_keys.end()) {
      node_->fail(
          key.source(),
          node_->prefix + std::string(key.str()) + ": unknown field; known here: " + [&] {
            std::string known;
            for (const std::string& name : node_->read_keys) {
              known += (known.empty() ? "" : ", ") + name;
            }
            return known;
          }());
    }
  }
}

namespace {

/// The string in quotes, and escaped where that is necessary.
std::string quoted(const std::string& text) {
  std::ostringstream out;
  out << toml::value<std::string>(text);
  return out.str();
}

template <class Values, class Format>
std::string array_text(const Values& values, const Format& format) {
  std::string text;
  for (const auto& value : values) text += (text.empty() ? "" : ", ") + format(value);
  return "[" + text + "]";
}

}  // namespace

TomlWriter& TomlWriter::comment(std::string_view text) {
  written_.append("# ").append(text).append("\n");
  return *this;
}

TomlWriter& TomlWriter::table(std::string_view name) {
  written_.append(written_.empty() ? "[" : "\n[").append(name).append("]\n");
  return *this;
}

TomlWriter& TomlWriter::element(std::string_view name) {
  return table("[" + std::string(name) + "]");
}

TomlWriter& TomlWriter::text(std::string_view key, std::string_view value, std::string_view note) {
  return field(key, quoted(std::string(value)), note);
}

TomlWriter& TomlWriter::number(std::string_view key, double value) {
  return field(key, toml_number(value));
}

TomlWriter& TomlWriter::integer(std::string_view key, int64_t value, std::string_view note) {
  return field(key, std::to_string(value), note);
}

TomlWriter& TomlWriter::boolean(std::string_view key, bool value) {
  return field(key, value ? "true" : "false");
}

TomlWriter& TomlWriter::numbers(std::string_view key, std::span<const double> values) {
  return field(key, array_text(values, toml_number));
}

TomlWriter& TomlWriter::integers(std::string_view key, std::span<const int64_t> values) {
  return field(key, array_text(values, [](int64_t value) { return std::to_string(value); }));
}

TomlWriter& TomlWriter::texts(std::string_view key, std::span<const std::string> values) {
  return field(key, array_text(values, quoted));
}

TomlWriter& TomlWriter::rows(std::string_view key, std::span<const std::vector<double>> rows) {
  return field(key, array_text(rows, [](const std::vector<double>& row) {
                 return array_text(row, toml_number);
               }));
}

TomlWriter& TomlWriter::field(std::string_view key, std::string_view value, std::string_view note) {
  written_.append(key).append(" = ").append(value);
  if (!note.empty()) written_.append("  # ").append(note);
  written_ += '\n';
  return *this;
}

std::string toml_number(double value) {
  // toml++ would write 17 digits: Debian builds it without std::to_chars for numbers.
  std::array<char, 40> text{};
  const auto end = std::to_chars(text.data(), text.data() + text.size(), value).ptr;
  std::string number(text.data(), end);
  // TOML distinguishes integers and floats by their spelling.
  return number.find_first_of(".en") == std::string::npos ? number + ".0" : number;
}

}  // namespace v3d
