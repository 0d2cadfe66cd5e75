#include "daemon/operator_client.h"

#include <limits.h>
#include <unistd.h>

#include <algorithm>

#include "daemon/bus.h"
#include "wire/channels.h"

namespace v3d {
namespace {

constexpr Duration kRepeatAfter = std::chrono::milliseconds(200);
constexpr size_t kQueue = 256;

bool is_final(const ReplyMessage& reply) {
  return reply.outcome != ReplyMessage::Outcome::kPending;
}

/// Unique per process: two tools may run at once, and process numbers come back.
std::string make_sender() {
  char host[HOST_NAME_MAX + 1] = {};
  gethostname(host, HOST_NAME_MAX);
  return std::string(host) + "." + std::to_string(getpid()) + "." +
         std::to_string(to_ns(Realtime::now()));
}

}  // namespace

std::vector<std::string> commanded_nodes(const Studio& studio) {
  std::vector<std::string> nodes;
  for (const StudioNode& node : studio.nodes) {
    const bool captures = node.name == studio.trigger.node || !studio.cameras_of(node.name).empty();
    if (captures || node.name == studio.reconstruction.node) nodes.push_back(node.name);
  }
  return nodes;
}

bool Answer::done() const {
  return silent.empty() && std::all_of(replies.begin(), replies.end(), [](const auto& entry) {
           return entry.second.outcome == ReplyMessage::Outcome::kDone;
         });
}

class OperatorClient::Impl {
 public:
  explicit Impl(const Studio& studio)
      : nodes(commanded_nodes(studio)),
        sender(make_sender()),
        bus(studio.network.lcm_url),
        replies(bus, kReplyChannel, kQueue),
        healths(bus, std::string(kHealthPrefix) + ".*", kQueue),
        events(bus, kEventChannel, kQueue) {}

  bool is_node(const std::string& name) const {
    return std::find(nodes.begin(), nodes.end(), name) != nodes.end();
  }

  bool all_final(const Answer& answer) const {
    return std::all_of(nodes.begin(), nodes.end(), [&](const std::string& node) {
      const auto found = answer.replies.find(node);
      return found != answer.replies.end() && is_final(found->second);
    });
  }

  /// Keeps a reply to our command, unless it is old news.
  void accept(const ReplyMessage& reply, int64_t command_counter, Answer& answer,
              const std::function<void(const ReplyMessage&)>& heard) const {
    if (reply.command_sender != sender || reply.command_counter != command_counter) return;
    if (!is_node(reply.node)) return;
    const auto known = answer.replies.find(reply.node);
    if (known != answer.replies.end()) {
      const ReplyMessage& last = known->second;
      if (is_final(last) || (last.outcome == reply.outcome && last.text == reply.text)) return;
    }
    answer.replies[reply.node] = reply;
    if (heard) heard(reply);
  }

  void remember(const HealthMessage& health) {
    if (is_node(health.node)) last_health[health.node] = health;
  }

  /// What a node said before it replied is in the queue by now: its messages come in their order.
  void forget_health() {
    while (healths.wait(Monotonic::now())) {
    }
    last_health.clear();
  }

  const std::vector<std::string> nodes;
  const std::string sender;
  int64_t counter = 0;
  std::map<std::string, HealthMessage> last_health;
  Bus bus;
  Subscription<ReplyMessage> replies;
  Subscription<HealthMessage> healths;
  Subscription<EventMessage> events;
  std::unique_ptr<Subscription<MeshMessage>> meshes;
};

OperatorClient::OperatorClient(const Studio& studio) : impl_(std::make_unique<Impl>(studio)) {}
OperatorClient::~OperatorClient() = default;

const std::vector<std::string>& OperatorClient::nodes() const { return impl_->nodes; }

Answer OperatorClient::command(CommandMessage command, MonotonicInstant deadline,
                               const std::function<void(const ReplyMessage&)>& heard) {
  command.sender = impl_->sender;
  command.counter = ++impl_->counter;
  Answer answer;
  while (!impl_->all_final(answer) && Monotonic::now() < deadline) {
    command.sent = Realtime::now();
    impl_->bus.publish(kCommandChannel, encode(command));
    const MonotonicInstant repeat = std::min(deadline, Monotonic::now() + kRepeatAfter);
    while (!impl_->all_final(answer)) {
      const auto reply = impl_->replies.wait(repeat);
      if (!reply) break;
      impl_->accept(*reply, command.counter, answer, heard);
    }
  }
  impl_->forget_health();
  for (const std::string& node : impl_->nodes) {
    if (!answer.replies.contains(node)) answer.silent.push_back(node);
  }
  return answer;
}

std::map<std::string, HealthMessage> OperatorClient::health(MonotonicInstant deadline) {
  // What is queued already is taken without waiting, so that the result is the newest.
  while (auto health = impl_->healths.wait(
             impl_->last_health.size() < impl_->nodes.size() ? deadline : Monotonic::now())) {
    impl_->remember(*health);
  }
  return impl_->last_health;
}

std::optional<HealthMessage> OperatorClient::next_health(MonotonicInstant deadline) {
  auto health = impl_->healths.wait(deadline);
  if (health) impl_->remember(*health);
  return health;
}

std::optional<EventMessage> OperatorClient::next_event(MonotonicInstant deadline) {
  return impl_->events.wait(deadline);
}

std::optional<MeshMessage> OperatorClient::next_mesh(MonotonicInstant deadline) {
  if (!impl_->meshes) {
    constexpr size_t kMeshQueue = 8;
    impl_->meshes =
        std::make_unique<Subscription<MeshMessage>>(impl_->bus, kMeshChannel, kMeshQueue);
  }
  return impl_->meshes->wait(deadline);
}

}  // namespace v3d
