#include "daemon/control/operator_client.h"

#include <limits.h>
#include <pwd.h>
#include <unistd.h>

#include <algorithm>
#include <utility>

#include "base/core/error.h"
#include "base/core/text.h"
#include "daemon/bus/bus.h"
#include "daemon/bus/credential_files.h"
#include "wire/messages.h"

namespace v3d::control {
namespace {

constexpr size_t kQueue = 256;
constexpr Duration kReloadPeriod = std::chrono::seconds(1);

std::string user_name() {
  const passwd* user = getpwuid(geteuid());
  return user != nullptr ? user->pw_name : std::to_string(geteuid());
}

/// "anna@desk/4711/1763...": user, host, process and time. The time makes it unique, because
/// process numbers are reused.
std::string make_sender() {
  char host[HOST_NAME_MAX + 1] = {};
  gethostname(host, HOST_NAME_MAX);
  return user_name() + "@" + host + "/" + std::to_string(getpid()) + "/" +
         std::to_string(to_ns(Realtime::now()));
}

/// Prefix of the text of unverified health.
constexpr char kUnverifiedPrefix[] = "not verified: ";

/// Decodes health for an operator. A node without a key cannot authenticate the report that it has
/// none. Its health is shown as a fault, unless verified health of this node arrived recently.
class HealthReader {
 public:
  std::optional<wire::HealthMessage> operator()(const bus::ReceivedMessage& in) {
    auto health = wire::decode<wire::HealthMessage>(in.bytes);
    if (!health) return std::nullopt;
    const MonotonicInstant now = Monotonic::now();
    if (in.is_accepted) {
      if (verified_.size() < kMaxNodes) verified_[health->node] = now;
      return health;
    }
    const auto known = verified_.find(health->node);
    if (known != verified_.end() && now - known->second < kVerifiedLasts) return std::nullopt;
    return wire::HealthMessage{
        .sent = health->sent,
        .seq = health->seq,
        .node = health->node,
        .program = health->program,
        .version = health->version,
        .state = wire::NodeState::kFault,
        .take = {},
        .text =
            kUnverifiedPrefix + (health->text.empty() ? "no valid MAC or signature" : health->text),
        .values = {}};
  }

 private:
  static constexpr Duration kVerifiedLasts = std::chrono::seconds(3);
  static constexpr size_t kMaxNodes = 256;
  std::map<std::string, MonotonicInstant> verified_;  ///< last verified health
};

/// Makes texts printable: an attacker may have written them.
wire::HealthMessage make_printable(wire::HealthMessage health) {
  for (std::string* text :
       {&health.node, &health.program, &health.version, &health.take, &health.text}) {
    *text = printable(*text);
  }
  std::map<std::string, double> values;
  for (const auto& [name, value] : health.values) values[printable(name)] = value;
  health.values = std::move(values);
  std::map<std::string, std::string> texts;
  for (const auto& [name, text] : health.texts) texts[printable(name)] = printable(text);
  health.texts = std::move(texts);
  return health;
}
wire::EventMessage make_printable(wire::EventMessage event) {
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

bool is_verified(const wire::HealthMessage& health) {
  return !health.text.starts_with(kUnverifiedPrefix);
}

class OperatorClient::Impl {
 public:
  explicit Impl(const Studio& studio)
      : nodes(commanded_nodes(studio)),
        trigger(studio.trigger.node),
        stamp(make_sender()),
        bus(studio.network.lcm_url, {}, bus::ChannelList(studio)),
        files(bus::credentials_of_operator(studio), credentials, bus.authenticator()),
        next_reload(read_credentials()),
        healths(bus, std::string(wire::kHealthPrefix) + ".*", kQueue, HealthReader(),
                bus::Bus::Accept::kIncludingUnverified),
        events(bus, wire::kEventChannel, kQueue) {}

  /// Returns when to read them again.
  MonotonicInstant read_credentials() {
    files.poll(Monotonic::now());
    return Monotonic::now() + kReloadPeriod;
  }

  /// Why there is no studio key; empty if there is one. Monitoring works without.
  std::string not_verified() const { return files.has_studio_key() ? "" : files.problem(); }

  /// Waits for the next message. Reloads the key files meanwhile, because keys may be replaced.
  template <class M>
  std::optional<M> wait(bus::Subscription<M>& subscription, MonotonicInstant deadline) {
    for (;;) {
      if (Monotonic::now() >= next_reload) next_reload = read_credentials();
      const MonotonicInstant until = std::min(deadline, next_reload);
      if (auto message = subscription.wait(until)) return message;
      if (until == deadline) return std::nullopt;
    }
  }

  bool is_node(const std::string& name) const {
    return std::find(nodes.begin(), nodes.end(), name) != nodes.end();
  }

  void start_commanding() {
    files.start_signing();
    next_reload = read_credentials();
    if (const std::string obstacle = files.obstacle(); !obstacle.empty()) {
      throw InputError(obstacle);
    }
    if (replies) return;
    replies = std::make_unique<bus::Subscription<wire::ReplyMessage>>(
        bus, wire::kReplyChannel, kQueue, [this](const bus::ReceivedMessage& in) {
          return credentials.open_reply(in.bytes, Monotonic::now());
        });
  }

  void send(wire::CommandMessage message) {
    stamp.apply(message, Realtime::now());
    bus.publish_command(credentials.authenticate(encode(message), Monotonic::now()));
  }

  void remember(const wire::HealthMessage& health) {
    if (!is_node(health.node)) return;
    last_health.erase(health.node);
    unverified.erase(health.node);
    (is_verified(health) ? last_health : unverified)[health.node] = health;
  }

  std::optional<wire::HealthMessage> next_health(MonotonicInstant deadline) {
    auto health = wait(healths, deadline);
    if (!health) return std::nullopt;
    explain(*health);
    health = make_printable(std::move(*health));
    remember(*health);
    return health;
  }

  /// Names the problem where the member list cannot be read here, so that no health is verified.
  void explain(wire::HealthMessage& health) const {
    if (!is_verified(health) && !files.problem().empty()) {
      health.text = kUnverifiedPrefix + files.problem();
    }
  }

  /// Discards health that nodes sent before their replies. It is in the queue by now, because the
  /// messages of a node arrive in order.
  void forget_health() {
    while (healths.wait(Monotonic::now())) {
    }
    last_health.clear();
    unverified.clear();
  }

  const std::vector<std::string> nodes;
  const std::string trigger;
  CommandStamp stamp;
  int64_t counter = 0;
  NodeNonces nonces;
  std::map<std::string, wire::HealthMessage> last_health;
  std::map<std::string, wire::HealthMessage> unverified;
  bus::Bus bus;
  bus::Credentials credentials;
  bus::CredentialFiles files;
  MonotonicInstant next_reload;
  std::unique_ptr<bus::Subscription<wire::ReplyMessage>> replies;  ///< null until the first command
  bus::Subscription<wire::HealthMessage> healths;
  bus::Subscription<wire::EventMessage> events;
  std::unique_ptr<bus::Subscription<wire::MeshMessage>> meshes;
  std::unique_ptr<bus::Subscription<wire::PulseMessage>> pulses;
  std::unique_ptr<bus::Subscription<wire::PreviewMessage>> previews;
};

OperatorClient::OperatorClient(const Studio& studio) : impl_(std::make_unique<Impl>(studio)) {}
OperatorClient::~OperatorClient() = default;

const std::vector<std::string>& OperatorClient::nodes() const { return impl_->nodes; }
std::string OperatorClient::not_verified() const { return impl_->not_verified(); }

Answer OperatorClient::command(wire::CommandMessage command, MonotonicInstant deadline,
                               const std::function<void(const wire::ReplyMessage&)>& on_reply) {
  impl_->start_commanding();
  StudioCoordinator coordinator(std::move(command), impl_->counter, {impl_->nodes, impl_->trigger},
                                deadline, impl_->nonces);
  while (!coordinator.is_finished()) {
    if (const auto message = coordinator.poll(Monotonic::now())) impl_->send(*message);
    auto reply = impl_->wait(*impl_->replies, coordinator.next_due());
    if (!reply || reply->command_sender != impl_->stamp.sender()) continue;
    reply->text = printable(reply->text);
    if (coordinator.on_reply(*reply) && on_reply) on_reply(*reply);
  }
  impl_->counter = coordinator.counter();
  impl_->nonces = coordinator.nonces();
  impl_->forget_health();
  return coordinator.answer();
}

std::map<std::string, wire::HealthMessage> OperatorClient::health(MonotonicInstant deadline) {
  // Take queued messages without waiting, so that the result is the newest.
  while (impl_->next_health(impl_->last_health.size() < impl_->nodes.size() ? deadline
                                                                            : Monotonic::now())) {
  }
  std::map<std::string, wire::HealthMessage> all = impl_->last_health;
  all.insert(impl_->unverified.begin(), impl_->unverified.end());
  return all;
}

std::optional<wire::HealthMessage> OperatorClient::next_health(MonotonicInstant deadline) {
  return impl_->next_health(deadline);
}

std::optional<wire::EventMessage> OperatorClient::next_event(MonotonicInstant deadline) {
  auto event = impl_->wait(impl_->events, deadline);
  if (event) event = make_printable(std::move(*event));
  return event;
}

std::optional<wire::MeshMessage> OperatorClient::next_mesh(MonotonicInstant deadline) {
  if (!impl_->meshes) {
    impl_->meshes = std::make_unique<bus::Subscription<wire::MeshMessage>>(
        impl_->bus, wire::kMeshChannel, kMeshQueue);
  }
  return impl_->wait(*impl_->meshes, deadline);
}

int64_t OperatorClient::dropped_meshes() const {
  return impl_->meshes ? impl_->meshes->counts().dropped : 0;
}

std::optional<wire::PulseMessage> OperatorClient::next_pulse(MonotonicInstant deadline) {
  if (!impl_->pulses) {
    impl_->pulses = std::make_unique<bus::Subscription<wire::PulseMessage>>(
        impl_->bus, wire::kPulseChannel, kQueue);
  }
  return impl_->wait(*impl_->pulses, deadline);
}

std::optional<wire::PreviewMessage> OperatorClient::next_preview(MonotonicInstant deadline) {
  if (!impl_->previews) {
    impl_->previews = std::make_unique<bus::Subscription<wire::PreviewMessage>>(
        impl_->bus, std::string(wire::kPreviewPrefix) + ".*", kQueue);
  }
  return impl_->wait(*impl_->previews, deadline);
}

}  // namespace v3d::control
