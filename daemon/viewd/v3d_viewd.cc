// v3d-viewd: shows the studio and its takes to browsers.
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <optional>

#include "base/core/error.h"
#include "daemon/control/operator_client.h"
#include "daemon/node/service.h"
#include "daemon/viewd/bus_relay.h"
#include "daemon/viewd/command_endpoint.h"
#include "daemon/viewd/dropped_meshes.h"
#include "daemon/viewd/operator_command.h"
#include "daemon/viewd/served_files.h"
#include "daemon/viewd/web_site.h"
#include "daemon/viewd/web_streams.h"
#include "daemon/web/web_server.h"

namespace {

constexpr v3d::Duration kPollPeriod = std::chrono::milliseconds(20);
constexpr v3d::Duration kClosingPeriod = std::chrono::minutes(1);
/// Time between SIGTERM to the relay process and to this one, when systemd stops both.
constexpr v3d::Duration kStopArrivesWithin = std::chrono::seconds(1);
constexpr char kRelayFlag[] = "--hear";
constexpr char kNoNetwork[] = "network.lcm_url is empty, so only recorded takes are shown";

std::string token_of(const v3d::Studio& studio, const v3d::web::WebAddress& address) {
  if (!studio.viewer.token.empty())
    return v3d::web::load_web_token(studio.viewer.token, "viewer.token");
  if (address.is_loopback()) return "";
  throw v3d::InputError(studio.path.string() + ": viewer.listen: " + studio.viewer.listen +
                        " is open to the network and requires viewer.token, a file with a token "
                        "for browsers; use 127.0.0.1 for this PC only");
}

/// Objects that are used on the server's thread only.
struct Served {
  v3d::viewd::LiveFeed& feed;
  v3d::viewd::StudioStatus& status;
  v3d::viewd::CommandEndpoint& commands;
  v3d::viewd::DroppedMeshes& dropped_meshes;
};

/// Passes commands to the runner, and their results to the subscribers.
void poll_commands(Served served, v3d::viewd::CommandRunner& runner, v3d::MonotonicInstant now) {
  if (const auto end = runner.poll(now)) served.commands.on_finished(*end);
  if (const auto command = served.commands.next_command()) runner.start(*command, now);
  while (const auto event = served.commands.next_event()) served.status.on_event(*event);
  served.status.set_report(served.commands.last_report());
}

/// Passes a relayed message to its receiver.
struct MessageHandler {
  Served served;
  v3d::MonotonicInstant now;
  void operator()(const v3d::viewd::NotVerified& reason) const {
    if (!reason.why.empty()) spdlog::warn("messages are not verified: {}", reason.why);
    served.status.set_not_verified(reason.why);
  }
  void operator()(const v3d::wire::MeshMessage& mesh) const { served.feed.add(mesh, now); }
  void operator()(const v3d::wire::HealthMessage& health) const {
    served.status.on_health(health, now);
  }
  void operator()(const v3d::wire::EventMessage& event) const { served.status.on_event(event); }
  void operator()(const v3d::wire::PreviewMessage& preview) const {
    served.status.on_preview(preview);
  }
};

/// The studio's network. Absent when the studio file has none (lcm_url is empty): then only
/// recorded takes are shown.
using Relay = std::optional<v3d::viewd::BusRelay>;

void wait_for_messages(Relay& relay) {
  const v3d::MonotonicInstant until = v3d::Monotonic::now() + kPollPeriod;
  if (relay) return relay->wait(until);
  v3d::node::stop_requested_by(until);  // nothing else can come
}

/// Passes messages of the studio to the subscribers.
void poll(Relay& relay, v3d::web::WebServer& server, Served served,
          v3d::viewd::CommandRunner& runner) {
  wait_for_messages(relay);
  const v3d::MonotonicInstant now = v3d::Monotonic::now();
  server.run_on_thread([&](int64_t subscribers) {
    while (const auto message = relay ? relay->next() : std::nullopt) {
      std::visit(MessageHandler{served, now}, *message);
    }
    if (const auto line = served.dropped_meshes.line(served.feed.counts(), now)) {
      spdlog::warn("{}", *line);
    }
    poll_commands(served, runner, now);
    served.status.set_subscriber_count(subscribers);
    served.status.refresh(now);
  });
}

/// Closes files of takes that are removed or unused, once in a period.
class FileClosing {
 public:
  FileClosing(const v3d::viewd::WebSite& site, v3d::web::WebServer& server)
      : site_(site), server_(server) {}

  void poll(v3d::MonotonicInstant now) {
    if (now < next_) return;
    next_ = now + kClosingPeriod;
    server_.start_work(site_.closing());
  }

 private:
  const v3d::viewd::WebSite& site_;
  v3d::web::WebServer& server_;
  v3d::MonotonicInstant next_ = v3d::Monotonic::now() + kClosingPeriod;
};

/// Runs until the service is stopped. The relay process may end first.
void serve(Relay& relay, v3d::web::WebServer& server, Served served,
           v3d::viewd::CommandRunner& runner, FileClosing& closing) {
  try {
    while (!v3d::node::stop_requested()) {
      poll(relay, server, served, runner);
      closing.poll(v3d::Monotonic::now());
      v3d::Realtime::adopt_step();  // no take depends on the time before a step here
      v3d::node::service::feed_watchdog();
    }
  } catch (const v3d::viewd::BusRelayEnded&) {
    if (!v3d::node::stop_requested_by(v3d::Monotonic::now() + kStopArrivesWithin)) throw;
  }
}

void run(const v3d::Studio& studio, const std::string& /*node*/) {
  const v3d::web::WebAddress address =
      v3d::web::parse_web_address(studio.viewer.listen, studio.path.string() + ": viewer.listen");
  const std::string token = token_of(studio, address);
  v3d::viewd::CommandEndpoint commands(studio, v3d::viewd::load_operator_token(studio, token));
  v3d::viewd::CommandRunner runner(studio);
  if (commands.is_open()) runner.require_v3dctl();
  v3d::viewd::WebSite site(studio, v3d::web::WebAccess(token),
                           v3d::viewd::find_page_files(studio.viewer.page), commands);
  Relay relay;
  const bool has_network = !studio.network.lcm_url.empty();
  if (has_network) relay.emplace(studio, kRelayFlag);
  v3d::viewd::LiveFeed feed;
  v3d::viewd::DroppedMeshes dropped_meshes;
  v3d::viewd::StudioStatus status(studio, v3d::control::commanded_nodes(studio),
                                  has_network ? "" : kNoNetwork);
  status.set_control(commands.is_open());
  const auto subscribe = [&](v3d::viewd::WebSite::StreamKind kind) {
    return kind == v3d::viewd::WebSite::StreamKind::kLive ? feed.subscribe(v3d::Monotonic::now())
                                                          : status.subscribe();
  };
  v3d::viewd::SiteHandler handler(site, subscribe);
  v3d::web::WebServer server(address, handler);
  const std::string host =
      address.host.find(':') == std::string::npos ? address.host : "[" + address.host + "]";
  spdlog::info("serves http://{}:{}/{}", host, server.port(),
               commands.is_open() ? ", and accepts orders" : "");
  v3d::node::service::ready();
  FileClosing closing(site, server);
  serve(relay, server, {feed, status, commands, dropped_meshes}, runner, closing);
  v3d::node::service::stopping();
}

void run_relay(const v3d::Studio& studio, const std::string& /*node*/) {
  v3d::viewd::relay_bus(studio, STDOUT_FILENO);
}

}  // namespace

int main(int argc, char** argv) {
  return v3d::node::daemon_main(
      argc, argv,
      {.name = "v3d-viewd",
       .purpose = "Shows a studio and its takes to browsers.",
       .is_a_node = false,
       .one_shot =
           v3d::node::DaemonOneShot{.flag = kRelayFlag,
                                    .purpose = "Write the messages of the studio's network to "
                                               "standard output (v3d-viewd starts itself with it)",
                                    .run = run_relay}},
      run);
}
