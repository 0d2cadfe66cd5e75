// Typed fields of a studio file. Internal to base/config/studio_file.cc. All functions throw
// InputError with file, line and field.
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

/// A number with at most ten significant digits, for messages.
std::string format_plain(double value);

/// A number within [low, high]; `fallback` when the field is missing.
double ranged(const TomlTable& table, std::string_view key, double fallback, double low,
              double high);
int ranged_int(const TomlTable& table, std::string_view key, int fallback, int low, int high);

/// A field with one of several words; returns the value of the word. `fallback`: the word of a
/// missing field; empty: the field is required.
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
  table.fail(key,
             (table.has(key) ? "'" + value + "' is unknown" : "missing") + "; known: " + known);
}

/// The field `name`: a valid file name.
std::string read_name(const TomlTable& table);

/// [x, y, z], metres.
Eigen::Vector3d read_point(const TomlTable& table, std::string_view key);

bool has_node(const Studio& studio, std::string_view name);
/// Throws when the studio has no node with the name `node`, which is the value of `key`.
void require_node(const TomlTable& table, std::string_view key, const Studio& studio,
                  const std::string& node);
/// The field `node`: the name of a node of the studio.
std::string read_node(const TomlTable& table, const Studio& studio);

/// The tables [camera_defaults] and [[camera]]. The nodes of the studio are known.
void read_cameras(const TomlTable& file, Studio& studio);

/// The fields of an action trigger in the table [trigger], except for the cameras.
void read_action(const TomlTable& table, StudioTrigger& trigger);
/// Gives the cameras the keys of an action trigger, and the trigger its cameras. Throws for cameras
/// that it cannot expose.
void assign_action_cameras(const TomlTable& file, Studio& studio);

/// The tables [[sound]]. The nodes of the studio are known.
void read_sounds(const TomlTable& file, Studio& studio);

/// The table [timecode_output]. The trigger is known.
void read_timecode_output(const TomlTable& file, Studio& studio);

/// The table [lights]. The nodes, the cameras and the trigger are known.
void read_lights(const TomlTable& file, Studio& studio);

/// A path of the file; a relative path starts at the folder of the studio file.
std::filesystem::path resolve(const Studio& studio, const std::string& path);

}  // namespace v3d
