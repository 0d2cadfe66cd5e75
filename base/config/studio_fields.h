// Typed fields of a studio file. Internal to base/config/studio_file.cc. All throw InputError with
// file, line and field.
#pragma once

#include <Eigen/Core>
#include <array>
#include <filesystem>
#include <string>
#include <string_view>
#include <utility>

#include "base/config/studio_file.h"
#include "base/config/toml_file.h"

namespace v3d {

/// A number in at most ten digits, for messages.
std::string plain(double value);

/// A number within [low, high]; `fallback` where the field is missing.
double ranged(const TomlTable& table, std::string_view key, double fallback, double low,
              double high);
int ranged_int(const TomlTable& table, std::string_view key, int fallback, int low, int high);

/// One of a few words, each with its meaning.
template <class T, size_t N>
T choice(const TomlTable& table, std::string_view key, std::string_view fallback,
         const std::array<std::pair<std::string_view, T>, N>& choices) {
  const std::string value = table.text_or(key, fallback);
  std::string known;
  for (const auto& [word, meaning] : choices) {
    if (value == word) {
      return meaning;
    }
    known += (known.empty() ? "" : ", ") + std::string(word);
  }
  table.fail(key, "'" + value + "' is unknown; known: " + known);
}

/// The field `name`: a name that can be that of a file.
std::string read_name(const TomlTable& table);

/// [x, y, z], metres.
Eigen::Vector3d read_point(const TomlTable& table, std::string_view key);

bool has_node(const Studio& studio, std::string_view name);
/// Refuses `node`, the value of `key`, where the studio has no such node.
void refuse_unknown_node(const TomlTable& table, std::string_view key, const Studio& studio,
                         const std::string& node);
/// The field `node`: the name of a node of the studio.
std::string read_node(const TomlTable& table, const Studio& studio);

/// A path of the file; relative paths begin in the folder of the studio file.
std::filesystem::path resolve(const Studio& studio, const std::string& path);

}  // namespace v3d
