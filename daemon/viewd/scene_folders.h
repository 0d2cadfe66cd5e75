// Folders of scenes (docs/scene.md), beside the takes: FOLDER/scene.json, and models and images.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace v3d {

/// Names of the folders in `takes` that contain a scene, ascending; empty if `takes` is unreadable.
std::vector<std::string> find_scenes(const std::filesystem::path& takes);

/// Is `file` in `folder` the scene, or a model, image or video by its extension? False for a folder
/// without a scene.
bool is_of_scene(const std::filesystem::path& folder, const std::string& file);

}  // namespace v3d
