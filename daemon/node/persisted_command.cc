#include "daemon/node/persisted_command.h"

#include <spdlog/spdlog.h>

#include "base/io/file.h"
#include "daemon/node/take_folder.h"
#include "take/take_removal.h"
#include "wire/codec.h"

namespace v3d {
namespace {

namespace fs = std::filesystem;

constexpr uint64_t kMaxOrderBytes = 1 << 20;

/// The name has the node, because several nodes on one PC may share the folder.
fs::path command_file(const fs::path& take, const std::string& node) {
  return take / (".order-" + node);
}

std::optional<CommandMessage> read_command(const fs::path& file) {
  const auto text = io::read_file(file, kMaxOrderBytes, io::OpenMode::kReadWithinFolder);
  if (!text) return std::nullopt;
  return decode<CommandMessage>(Bytes(text->begin(), text->end()));
}

}  // namespace

void persist_command(const Studio& studio, const std::string& node, const CommandMessage& order) {
  const Bytes bytes = encode(order);
  const auto saved = io::replace_file(command_file(take_paths(studio, order.take).folder, node),
                                      std::string(bytes.begin(), bytes.end()));
  if (!saved) spdlog::warn("{}", saved.error().message);
}

void drop_command(const Studio& studio, const std::string& node, const std::string& take) {
  remove_working_file(command_file(take_paths(studio, take).folder, node));
}

std::map<std::string, CommandMessage> persisted_commands(const Studio& studio,
                                                         const std::string& node) {
  std::map<std::string, CommandMessage> orders;
  const auto takes = io::list_folder(studio.storage.takes);
  for (const fs::path& take : takes.value_or(std::vector<fs::path>())) {
    const std::string name = take.filename().string();
    auto order = read_command(command_file(take, node));
    if (order && order->take == name) orders.emplace(name, std::move(*order));
  }
  return orders;
}

std::optional<RejoinDecision::Found> RejoinDecision::decide(
    const TrainState::RunningTake& running) {
  const auto found = commands_.find(running.take);
  std::optional<Found> order;
  if (found != commands_.end()) order = {std::move(found->second), running.commanded};
  commands_.clear();
  return order;
}

PersistedCommands::PersistedCommands(const Studio& studio, std::string node)
    : studio_(studio), node_(std::move(node)), decision_(persisted_commands(studio, node_)) {}

std::optional<PersistedCommands::Found> PersistedCommands::find_running(TrainMonitor& train) {
  if (!decision_.is_open()) return std::nullopt;
  const auto running = train.running();
  return running ? decision_.decide(*running) : std::nullopt;
}

void PersistedCommands::drop_all() {
  for (const auto& [take, order] : persisted_commands(studio_, node_))
    drop_command(studio_, node_, take);
  decision_.close();
}

}  // namespace v3d
