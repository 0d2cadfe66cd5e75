#include "base/config/studio_fields.h"

#include <fmt/core.h>

#include <algorithm>

#include "base/core/text.h"

namespace v3d {
std::string format_plain(double value) { return fmt::format("{:.10g}", value); }

double ranged(const TomlTable& table, std::string_view key, double fallback, double low,
              double high) {
  const double value = table.number_or(key, fallback);
  if (value < low || value > high) {
    table.fail(key, "expected a number from " + format_plain(low) + " to " + format_plain(high) +
                        ", found " + format_plain(value));
  }
  return value;
}

int ranged_int(const TomlTable& table, std::string_view key, int fallback, int low, int high) {
  const int64_t value = table.integer_or(key, fallback);
  if (value < low || value > high) {
    table.fail(key, "expected a whole number from " + std::to_string(low) + " to " +
                        std::to_string(high) + ", found " + std::to_string(value));
  }
  return static_cast<int>(value);
}

std::string read_name(const TomlTable& table) {
  const std::string name = table.text("name");
  if (!is_file_name(name)) {
    table.fail("name", "'" + name + "': " + std::string(kFileNameRule));
  }
  return name;
}

Eigen::Vector3d read_point(const TomlTable& table, std::string_view key) {
  const std::vector<double> v = table.numbers(key);
  if (v.size() != 3) {
    table.fail(key, "expected [x, y, z] in metres");
  }
  return {v[0], v[1], v[2]};
}

bool has_node(const Studio& studio, std::string_view name) {
  return std::any_of(studio.nodes.begin(), studio.nodes.end(),
                     [&](const StudioNode& n) { return n.name == name; });
}

void require_node(const TomlTable& table, std::string_view key, const Studio& studio,
                  const std::string& node) {
  if (!has_node(studio, node)) table.fail(key, "there is no [[node]] named '" + node + "'");
}

std::string read_node(const TomlTable& table, const Studio& studio) {
  const std::string node = table.text("node");
  require_node(table, "node", studio, node);
  return node;
}

std::filesystem::path resolve(const Studio& studio, const std::string& path) {
  return studio.path.parent_path() / path;
}

}  // namespace v3d
