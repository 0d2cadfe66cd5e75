// The capture nodes of a take, from the studio file at the time of the recording.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "base/config/toml_file.h"
#include "take/take.h"

namespace v3d {

/// A capture node of a take, with its cameras in the studio file. A camera may have been missing in
/// the take (arm --allow-missing).
struct TakeNode {
  std::string name;
  std::vector<std::string> cameras;
  friend bool operator==(const TakeNode&, const TakeNode&) = default;
};

/// All capture nodes of a take, sorted by name: those with cameras, and that of the trigger. Empty
/// for a take without a studio file, as an imported one. Throws InputError when the studio file
/// cannot be read.
std::vector<TakeNode> capture_nodes(const TakePaths& paths);

/// The node as a table `[[key]]` of TOML, and the nodes of all such tables.
std::string toml_of(std::string_view key, const TakeNode& node);
std::vector<TakeNode> read_nodes(const TomlTable& table, std::string_view key);

/// "cap02 (cam03, cam04), cap03".
std::string text_of(const std::vector<TakeNode>& nodes);

}  // namespace v3d
