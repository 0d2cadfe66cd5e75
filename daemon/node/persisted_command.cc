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

constexpr uint64_t kMaxOrderBytes = 1 << 20;

/// The name has the node, because several nodes on one PC may share the folder.
fs::path command_file(const fs::path& take, const std::string& node) {
  return take / (".order-" + node);
}

/// Empty without such a file, and for a file beside the takes.
io::Result<std::optional<wire::CommandMessage>> read_command(const fs::path& file) {
  const auto text = io::read_file(file, kMaxOrderBytes, io::OpenMode::kReadWithinFolder);
  if (!text && (text.error().code == ENOENT || text.error().code == ENOTDIR)) return std::nullopt;
  if (!text) return tl::make_unexpected(text.error());
  auto command = wire::decode<wire::CommandMessage>(wire::Bytes(text->begin(), text->end()));
  if (!command) return io::io_error("read", file, "it is damaged", EBADMSG);
  return command;
}

}  // namespace

void persist_command(const Studio& studio, const std::string& node,
                     const wire::CommandMessage& order) {
  const wire::Bytes bytes = encode(order);
  const auto saved = io::replace_file(command_file(take_paths(studio, order.take).folder, node),
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
    auto order = read_command(command_file(take, node));
    if (!order) {
      spdlog::error("{}", order.error().message);
      found.unread.insert(name);
    } else if (*order && (*order)->take == name) {
      found.commands.emplace(name, *std::move(*order));
    }
  }
  return found;
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
  const bool may_lack_orders = !on_disk_.unread.empty() || !on_disk_.folder_was_listed;
  if (!decision_.is_open() && !may_lack_orders) return std::nullopt;
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
  for (const auto& [take, order] : found.commands) drop_command(studio_, node_, take);
  for (const std::string& take : found.unread) drop_command(studio_, node_, take);
  on_disk_ = {};
  decision_.close();
}

namespace {

constexpr size_t kHealthQueue = 8;

/// Empty for an implausible number.
std::optional<int64_t> commanded_by(const wire::HealthMessage& health) {
  const auto commanded = health.values.find("pulses_commanded");
  if (commanded == health.values.end()) return std::nullopt;
  if (!(commanded->second >= 0 && commanded->second < 1e9)) return std::nullopt;
  return static_cast<int64_t>(commanded->second);
}

std::optional<ReceivedHealth> open_health(const bus::ReceivedMessage& in) {
  if (!in.is_accepted) return std::nullopt;
  auto health = wire::decode<wire::HealthMessage>(in.bytes);
  if (!health || in.channel != wire::health_channel(health->node)) return std::nullopt;
  return ReceivedHealth{
      .health = *std::move(health), .session = in.session, .received = Monotonic::now()};
}

}  // namespace

bool HealthOrder::is_newest(const ReceivedHealth& message) {
  if (std::ranges::find(former_, message.session) != former_.end()) return false;
  if (session_ == message.session) {
    if (message.health.seq <= seq_) return false;
  } else if (session_) {
    if (former_.size() == kMaxFormer) former_.pop_front();
    former_.push_back(*session_);
  }
  session_ = message.session;
  seq_ = message.health.seq;
  return true;
}

void TrainState::reset(MonotonicInstant now) {
  began_ = now;
  ended_ = was_running_ = false;
  commanded_ = 0;
}

std::optional<TrainState::RunningTake> TrainState::running(const ReceivedHealth& message) {
  if (!order_.is_newest(message)) return std::nullopt;
  const wire::HealthMessage& health = message.health;
  const bool records = health.state == wire::NodeState::kRecording;
  was_running_ = records;
  return RunningTake{.take = records ? health.take : "",
                     .commanded = commanded_by(health).value_or(0)};
}

void TrainState::on_health(const ReceivedHealth& message, const std::string& take) {
  if (!order_.is_newest(message)) return;
  const wire::HealthMessage& health = message.health;
  const bool ours = health.take == take;
  const bool is_running = ours && (health.state == wire::NodeState::kArmed ||
                                   health.state == wire::NodeState::kRecording);
  was_running_ = was_running_ || is_running;
  // Until the node is known to run, messages from before it was armed may still be in flight.
  const bool is_current = was_running_ || message.received - began_ > kMaxAge;
  ended_ = ended_ || (!is_running && is_current);
  if (ours) commanded_ = commanded_by(health).value_or(commanded_);
}

TrainMonitor::TrainMonitor(bus::Bus& bus, const std::string& trigger_node)
    : health_(bus, wire::health_channel(trigger_node), kHealthQueue, open_health) {}

void TrainMonitor::reset() {
  while (const auto health = health_.wait(Monotonic::now())) train_.note(*health);
  train_.reset(Monotonic::now());
}

void TrainMonitor::poll(const std::string& take) {
  while (const auto health = health_.wait(Monotonic::now())) train_.on_health(*health, take);
}

std::optional<TrainMonitor::RunningTake> TrainMonitor::running() {
  std::optional<RunningTake> running;
  while (const auto health = health_.wait(Monotonic::now())) {
    if (auto newer = train_.running(*health)) running = std::move(newer);
  }
  return running;
}

}  // namespace v3d::node
