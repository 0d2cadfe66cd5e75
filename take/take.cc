#include "take/take.h"

#include <algorithm>

#include "base/config/calib_file.h"
#include "base/config/toml_file.h"
#include "base/core/error.h"
#include "base/core/text.h"
#include "base/io/file.h"

namespace v3d::take {
namespace {

struct StateName {
  TakeState state;
  std::string_view name;
};
constexpr StateName kStateNames[] = {{TakeState::kRecording, "recording"},
                                     {TakeState::kComplete, "complete"},
                                     {TakeState::kRecovered, "recovered"}};

TakeState read_state(const TomlTable& table) {
  const std::string text = table.text("state");
  for (const auto& [state, state_name] : kStateNames) {
    if (text == state_name) return state;
  }
  table.fail("state", "expected \"recording\", \"complete\" or \"recovered\"");
}

std::vector<std::string> read_cameras(const TomlTable& table) {
  std::vector<std::string> cameras = table.texts("cameras");
  for (const std::string& camera : cameras) {
    if (!is_file_name(camera)) {
      table.fail("cameras", "'" + camera + "' cannot name a camera: " + std::string(kFileNameRule));
    }
  }
  return cameras;
}

}  // namespace

std::string_view name(TakeState state) {
  for (const auto& [known, state_name] : kStateNames) {
    if (state == known) return state_name;
  }
  return "unknown";
}

io::Result<std::vector<std::filesystem::path>> list_take_folders(
    const std::filesystem::path& takes) {
  auto entries = io::list_folder(takes);
  if (!entries) return entries;
  std::erase_if(*entries, [](const std::filesystem::path& entry) {
    return entry.filename().string().starts_with(".") || entry.filename() == "lost+found";
  });
  return entries;
}

io::Result<bool> holds_logs(const std::filesystem::path& folder) {
  const auto type = io::type_of(folder);
  if (!type) return tl::make_unexpected(type.error());
  if (*type != std::filesystem::file_type::directory) return false;
  return io::list_folder(folder).map([](const std::vector<std::filesystem::path>& entries) {
    return std::ranges::any_of(
        entries, [](const std::filesystem::path& entry) { return entry.extension() == ".lcmlog"; });
  });
}

std::string missing_info_text(const std::filesystem::path& folder) {
  const std::string text = "has logs and no take.toml; ";
  const std::string suffix = folder.extension();
  if (suffix.starts_with(".partial-") &&
      suffix.size() == std::string_view(".partial-").size() + 6) {
    return text + "by its name, a v3dctl import that was killed has left it; if so, remove it";
  }
  return text + "a check of the file system may have moved it to lost+found";
}

TakeInfo load_take_info(const TakePaths& paths) {
  if (io::value_or_throw(io::type_of(paths.folder)) != std::filesystem::file_type::directory) {
    throw InputError(paths.folder.string() +
                     ": no such folder; expected a take folder with take.toml");
  }
  if (!file_exists(paths.info())) {
    throw InputError(paths.folder.string() + ": is not a take folder: take.toml is missing");
  }
  return parse_take_info(read_take_text(paths.info()), paths.info());
}

bool is_edited(const TakePaths& paths) {
  return file_exists(paths.edit()) && !file_exists(paths.ledger()) && !file_exists(paths.pulses());
}

Rig load_take_calib(const TakePaths& paths) {
  return parse_calib(read_take_text(paths.calib()), paths.calib());
}

std::optional<Studio> load_take_studio(const TakePaths& paths) {
  const auto kind = io::value_or_throw(io::entry_type_of(paths.studio()));
  if (kind == std::filesystem::file_type::not_found) return std::nullopt;
  return parse_recorded_studio(read_take_text(paths.studio()), paths.studio());
}

TakeInfo parse_take_info(std::string_view text, const std::filesystem::path& path) {
  const TomlTable table = TomlTable::parse(text, path);
  TakeInfo info;
  info.name = table.text("name");
  if (!is_file_name(info.name)) {
    table.fail("name", "'" + info.name + "' cannot name a take: " + std::string(kFileNameRule));
  }
  info.studio = table.text("studio");
  info.rate_hz = table.number("rate_hz");
  if (info.rate_hz <= 0) table.fail("rate_hz", "expected a positive number of pulses per second");
  info.pulses = table.integer("pulses");
  if (info.pulses < 0 || info.pulses > kMaxPulses) {
    table.fail("pulses", "expected a count, 0 to " + format_count(kMaxPulses));
  }
  info.state = read_state(table);
  info.software_version = table.text("software_version");
  info.started = from_ns<Realtime>(table.integer("started_ns"));
  info.cameras = read_cameras(table);
  table.reject_unknown_fields();
  return info;
}

std::string take_info_text(const TakeInfo& info) {
  TomlWriter file;
  file.text("name", info.name)
      .text("studio", info.studio)
      .number("rate_hz", info.rate_hz)
      .integer("pulses", info.pulses)
      .text("state", name(info.state))
      .text("software_version", info.software_version)
      .integer("started_ns", to_ns(info.started), "since 1970, CLOCK_REALTIME")
      .texts("cameras", info.cameras);
  return file.written();
}

io::Status save_take_info(const TakePaths& paths, const TakeInfo& info) {
  return io::replace_file(paths.info(), take_info_text(info));
}

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

void write_node(std::string_view key, const TakeNode& node, TomlWriter& file) {
  file.element(key).text("name", node.name).texts("cameras", node.cameras);
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

}  // namespace v3d::take
