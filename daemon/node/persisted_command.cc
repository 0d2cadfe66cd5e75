#include "daemon/node/persisted_command.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <utility>

#include "base/io/file.h"
#include "daemon/node/take_folder.h"
#include "take/take_removal.h"
#include "wire/codec.h"
#include "wire/messages.h"

namespace v3d::node {
namespace {

namespace fs = std::filesystem;

constexpr uint64_t kMaxCommandBytes = 1 << 20;

/// The name has the node, because several nodes on one PC may share the folder.
fs::path command_file(const fs::path& take, const std::string& node) {
  return take / (".order-" + node);
}

/// Empty without such a file, and for a file beside the takes.
io::Result<std::optional<wire::CommandMessage>> read_command(const fs::path& file) {
  const auto text = io::read_file(file, kMaxCommandBytes, io::OpenMode::kReadWithinFolder);
  if (!text && (text.error().code == ENOENT || text.error().code == ENOTDIR)) return std::nullopt;
  if (!text) return tl::make_unexpected(text.error());
  auto command = wire::decode<wire::CommandMessage>(wire::Bytes(text->begin(), text->end()));
  if (!command) return io::io_error("read", file, "it is damaged", EBADMSG);
  return command;
}

}  // namespace

void persist_command(const Studio& studio, const std::string& node,
                     const wire::CommandMessage& command) {
  const wire::Bytes bytes = encode(command);
  const auto saved = io::replace_file(command_file(take_paths(studio, command.take).folder, node),
                                      std::string(bytes.begin(), bytes.end()));
  if (!saved) spdlog::warn("{}", saved.error().message);
}

void drop_command(const Studio& studio, const std::string& node, const std::string& take) {
  take::remove_working_file(command_file(take_paths(studio, take).folder, node));
}

io::Result<bool> has_persisted_command(const take::TakePaths& take, const std::string& node) {
  return io::type_of(command_file(take.folder, node)).map([](fs::file_type type) {
    return type != fs::file_type::not_found;
  });
}

CommandsOnDisk persisted_commands(const Studio& studio, const std::string& node) {
  CommandsOnDisk found;
  const auto takes = take::list_take_folders(studio.storage.takes);
  found.folder_was_listed = takes || takes.error().code == ENOENT;
  if (!found.folder_was_listed) spdlog::error("{}", takes.error().message);
  for (const fs::path& take : takes.value_or(std::vector<fs::path>())) {
    const std::string name = take.filename().string();
    auto command = read_command(command_file(take, node));
    if (!command) {
      spdlog::error("{}", command.error().message);
      found.unread.insert(name);
    } else if (*command && (*command)->take == name) {
      found.commands.emplace(name, *std::move(*command));
    }
  }
  return found;
}

std::optional<RejoinDecision::Found> RejoinDecision::decide(
    const TrainState::RunningTake& running) {
  const auto command = commands_.find(running.take);
  std::optional<Found> found;
  if (command != commands_.end()) found = {std::move(command->second), running.commanded};
  commands_.clear();
  return found;
}

PersistedCommands::PersistedCommands(const Studio& studio, std::string node)
    : studio_(studio), node_(std::move(node)), decision_({}) {
  read();
}

void PersistedCommands::read() {
  on_disk_ = persisted_commands(studio_, node_);
  read_at_ = Monotonic::now();
  decision_ = RejoinDecision(std::exchange(on_disk_.commands, {}));
}

std::optional<PersistedCommands::Found> PersistedCommands::find_running(TrainMonitor& train) {
  constexpr Duration kPause = std::chrono::seconds(1);
  const bool may_lack_commands = !on_disk_.unread.empty() || !on_disk_.folder_was_listed;
  if (!decision_.is_open() && !may_lack_commands) return std::nullopt;
  const auto running = train.running();
  if (!running) return std::nullopt;
  if (!on_disk_.folder_was_listed || on_disk_.unread.contains(running->take)) {
    if (Monotonic::now() - read_at_ >= kPause) read();
    return std::nullopt;
  }
  on_disk_ = {};
  return decision_.decide(*running);
}

void PersistedCommands::drop_all() {
  const CommandsOnDisk found = persisted_commands(studio_, node_);
  for (const auto& [take, command] : found.commands) drop_command(studio_, node_, take);
  for (const std::string& take : found.unread) drop_command(studio_, node_, take);
  on_disk_ = {};
  decision_.close();
}

}  // namespace v3d::node
