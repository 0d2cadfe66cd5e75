#include "take/take_nodes.h"

#include <algorithm>

#include "base/core/name.h"

namespace v3d {

std::vector<TakeNode> capture_nodes(const TakePaths& paths) {
  const std::optional<Studio> studio = load_take_studio(paths);
  if (!studio) return {};
  std::vector<TakeNode> nodes;
  for (const StudioNode& node : studio->nodes) {
    TakeNode found{.name = node.name, .cameras = {}};
    for (const StudioCamera& camera : studio->cameras_of(node.name)) {
      found.cameras.push_back(camera.name);
    }
    const bool records = !found.cameras.empty() || studio->trigger.node == node.name;
    if (records) nodes.push_back(std::move(found));
  }
  std::ranges::sort(nodes, {}, &TakeNode::name);
  return nodes;
}

std::string toml_of(std::string_view key, const TakeNode& node) {
  std::string cameras;
  for (const std::string& camera : node.cameras) {
    cameras += (cameras.empty() ? "" : ", ") + toml_string(camera);
  }
  return "\n[[" + std::string(key) + "]]\nname = " + toml_string(node.name) + "\ncameras = [" +
         cameras + "]\n";
}

std::vector<TakeNode> read_nodes(const TomlTable& table, std::string_view key) {
  std::vector<TakeNode> nodes;
  for (const TomlTable& node : table.tables(key)) {
    nodes.push_back({.name = node.text("name"), .cameras = node.texts("cameras")});
    node.reject_unknown_fields();
  }
  return nodes;
}

std::string text_of(const std::vector<TakeNode>& nodes) {
  std::vector<std::string> texts;
  for (const TakeNode& node : nodes) {
    const std::string cameras = join_names(node.cameras);
    texts.push_back(node.name + (cameras.empty() ? "" : " (" + cameras + ")"));
  }
  return join_names(texts);
}

}  // namespace v3d
