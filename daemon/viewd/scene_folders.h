// Scenes (docs/scene.md) lie in folders beside the takes: FOLDER/scene.json, and the models and
// pictures that it names.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace v3d {

/// Names of the folders in `takes` that hold a scene, rising; none where the folder cannot be read.
std::vector<std::string> find_scenes(const std::filesystem::path& takes);

/// Whether `file` of `folder` is the scene, or may be shown in it by its ending; nothing of a
/// folder without a scene is.
bool is_of_scene(const std::filesystem::path& folder, const std::string& file);

}  // namespace v3d
