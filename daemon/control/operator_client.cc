#include "daemon/control/operator_client.h"

#include <limits.h>
#include <pwd.h>
#include <unistd.h>

#include <algorithm>
#include <utility>

#include "base/error.h"
#include "base/printable.h"
#include "daemon/bus/bus.h"
#include "daemon/bus/credential_files.h"
#include "wire/channels.h"

namespace v3d {
namespace {

constexpr size_t kQueue = 256;
constexpr Duration kReadAgainAfter = std::chrono::seconds(1);

std::string user_name() {
  const passwd* user = getpwuid(geteuid());
  return user != nullptr ? user->pw_name : std::to_string(geteuid());
}

/// Whom a person would name, and what is unique: two tools may run at once, and process numbers
/// come back.
std::string make_sender() {
  char host[HOST_NAME_MAX + 1] = {};
  gethostname(host, HOST_NAME_MAX);
  return user_name() + "@" + host + "/" + std::to_string(getpid()) + "/" +
         std::to_string(to_ns(Realtime::now()));
}

/// Begins the text of health that carries no seal: it may be anybody's.
constexpr char kNotBelieved[] = "not believed: ";

/// Health as an operator may see it. A node without a key cannot seal that it has none: such health
/// shows as a fault, and only of nodes that are not heard otherwise.
class HealthReader {
 public:
  std::optional<HealthMessage> operator()(const ReceivedMessage& in) {
    auto health = decode<HealthMessage>(in.bytes);
    if (!health) return std::nullopt;
    const MonotonicInstant now = Monotonic::now();
    if (in.is_accepted) {
      if (heard_.size() < kMaxNodes) heard_[health->node] = now;
      return health;
    }
    const auto known = heard_.find(health->node);
    if (known != heard_.end() && now - known->second < kForgotten) return std::nullopt;
    return HealthMessage{
        .sent = health->sent,
        .seq = health->seq,
        .node = health->node,
        .program = health->program,
        .version = health->version,
        .state = NodeState::kFault,
        .take = {},
        .text = kNotBelieved + (health->text.empty() ? "not sealed" : health->text),
        .values = {}};
  }

 private:
  static constexpr Duration kForgotten = std::chrono::seconds(3);
  static constexpr size_t kMaxNodes = 256;
  std::map<std::string, MonotonicInstant> heard_;  ///< sealed
};

/// What strangers may have written comes to the operator's screen.
HealthMessage fit_for_screen(HealthMessage health) {
  for (std::string* text :
       {&health.node, &health.program, &health.version, &health.take, &health.text}) {
    *text = printable(*text);
  }
  std::map<std::string, double> values;
  for (const auto& [name, value] : health.values) values[printable(name)] = value;
  health.values = std::move(values);
  return health;
}
EventMessage fit_for_screen(EventMessage event) {
  for (std::string* text : {&event.node, &event.subject, &event.text}) *text = printable(*text);
  return event;
}

}  // namespace

std::vector<std::string> commanded_nodes(const Studio& studio) {
  std::vector<std::string> nodes;
  for (const StudioNode& node : studio.nodes) {
    const bool captures = node.name == studio.trigger.node || !studio.cameras_of(node.name).empty();
    if (captures || studio.reconstructs(node.name)) nodes.push_back(node.name);
  }
  return nodes;
}

bool is_believed(const HealthMessage& health) { return !health.text.starts_with(kNotBelieved); }

class OperatorClient::Impl {
 public:
  explicit Impl(const Studio& studio)
      : nodes(commanded_nodes(studio)),
        trigger(studio.trigger.node),
        stamp(make_sender()),
        bus(studio.network.lcm_url, {}, ChannelList(studio)),
        files(credentials_of_operator(studio), credentials, bus.seal()),
        not_verified(read_credentials()),
        healths(bus, std::string(kHealthPrefix) + ".*", kQueue, HealthReader(),
                Bus::Accept::kUnverifiedToo),
        events(bus, kEventChannel, kQueue) {}

  /// The key is not needed to look on. Why there is none, or nothing.
  std::string read_credentials() {
    next_reading = Monotonic::now() + kReadAgainAfter;
    files.poll(Monotonic::now());
    return files.has_studio_key() ? "" : files.problem();
  }

  /// The next message in `inbox`. Reads the key files again meanwhile: a key may be replaced.
  template <class M>
  std::optional<M> wait(Subscription<M>& inbox, MonotonicInstant deadline) {
    for (;;) {
      if (Monotonic::now() >= next_reading) read_credentials();
      const MonotonicInstant until = std::min(deadline, next_reading);
      if (auto message = inbox.wait(until)) return message;
      if (until == deadline) return std::nullopt;
    }
  }

  bool is_node(const std::string& name) const {
    return std::find(nodes.begin(), nodes.end(), name) != nodes.end();
  }

  void begin_to_command() {
    files.start_signing();
    read_credentials();
    if (const std::string obstacle = files.obstacle(); !obstacle.empty()) {
      throw InputError(obstacle);
    }
    if (replies) return;
    replies = std::make_unique<Subscription<ReplyMessage>>(
        bus, kReplyChannel, kQueue, [this](const ReceivedMessage& in) {
          return credentials.open_reply(in.bytes, Monotonic::now());
        });
  }

  void send(CommandMessage message) {
    stamp.put_on(message, Realtime::now());
    bus.publish_command(credentials.seal(encode(message), Monotonic::now()));
  }

  void remember(const HealthMessage& health) {
    if (!is_node(health.node)) return;
    last_health.erase(health.node);
    unbelieved.erase(health.node);
    (is_believed(health) ? last_health : unbelieved)[health.node] = health;
  }

  std::optional<HealthMessage> next_health(MonotonicInstant deadline) {
    auto health = wait(healths, deadline);
    if (!health) return std::nullopt;
    health = fit_for_screen(std::move(*health));
    remember(*health);
    return health;
  }

  /// What a node said before it replied is in the queue by now: its messages come in their order.
  void forget_health() {
    while (healths.wait(Monotonic::now())) {
    }
    last_health.clear();
    unbelieved.clear();
  }

  const std::vector<std::string> nodes;
  const std::string trigger;
  CommandStamp stamp;
  int64_t counter = 0;
  NodeNonces nonces;
  std::map<std::string, HealthMessage> last_health;
  std::map<std::string, HealthMessage> unbelieved;
  Bus bus;
  Credentials credentials;
  CredentialFiles files;
  MonotonicInstant next_reading;
  const std::string not_verified;
  std::unique_ptr<Subscription<ReplyMessage>> replies;  ///< once there is a key
  Subscription<HealthMessage> healths;
  Subscription<EventMessage> events;
  std::unique_ptr<Subscription<MeshMessage>> meshes;
  std::unique_ptr<Subscription<PulseMessage>> pulses;
  std::unique_ptr<Subscription<PreviewMessage>> previews;
};

OperatorClient::OperatorClient(const Studio& studio) : impl_(std::make_unique<Impl>(studio)) {}
OperatorClient::~OperatorClient() = default;

const std::vector<std::string>& OperatorClient::nodes() const { return impl_->nodes; }
const std::string& OperatorClient::not_verified() const { return impl_->not_verified; }

Answer OperatorClient::command(CommandMessage command, MonotonicInstant deadline,
                               const std::function<void(const ReplyMessage&)>& heard) {
  impl_->begin_to_command();
  StudioCoordinator conversation(std::move(command), impl_->counter, {impl_->nodes, impl_->trigger},
                                 deadline, impl_->nonces);
  while (!conversation.over()) {
    if (const auto message = conversation.poll(Monotonic::now())) impl_->send(*message);
    auto reply = impl_->wait(*impl_->replies, conversation.next_due());
    if (!reply || reply->command_sender != impl_->stamp.sender()) continue;
    reply->text = printable(reply->text);
    if (conversation.hear(*reply) && heard) heard(*reply);
  }
  impl_->counter = conversation.counter();
  impl_->nonces = conversation.nonces();
  impl_->forget_health();
  return conversation.answer();
}

std::map<std::string, HealthMessage> OperatorClient::health(MonotonicInstant deadline) {
  // What is queued already is taken without waiting, so that the result is the newest.
  while (impl_->next_health(impl_->last_health.size() < impl_->nodes.size() ? deadline
                                                                            : Monotonic::now())) {
  }
  std::map<std::string, HealthMessage> all = impl_->last_health;
  all.insert(impl_->unbelieved.begin(), impl_->unbelieved.end());
  return all;
}

std::optional<HealthMessage> OperatorClient::next_health(MonotonicInstant deadline) {
  return impl_->next_health(deadline);
}

std::optional<EventMessage> OperatorClient::next_event(MonotonicInstant deadline) {
  auto event = impl_->wait(impl_->events, deadline);
  if (event) event = fit_for_screen(std::move(*event));
  return event;
}

std::optional<MeshMessage> OperatorClient::next_mesh(MonotonicInstant deadline) {
  if (!impl_->meshes) {
    constexpr size_t kMeshQueue = 8;
    impl_->meshes =
        std::make_unique<Subscription<MeshMessage>>(impl_->bus, kMeshChannel, kMeshQueue);
  }
  return impl_->wait(*impl_->meshes, deadline);
}

std::optional<PulseMessage> OperatorClient::next_pulse(MonotonicInstant deadline) {
  if (!impl_->pulses) {
    impl_->pulses = std::make_unique<Subscription<PulseMessage>>(impl_->bus, kPulseChannel, kQueue);
  }
  return impl_->wait(*impl_->pulses, deadline);
}

std::optional<PreviewMessage> OperatorClient::next_preview(MonotonicInstant deadline) {
  if (!impl_->previews) {
    impl_->previews = std::make_unique<Subscription<PreviewMessage>>(
        impl_->bus, std::string(kPreviewPrefix) + ".*", kQueue);
  }
  return impl_->wait(*impl_->previews, deadline);
}

}  // namespace v3d
