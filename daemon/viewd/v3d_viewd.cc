// v3d-viewd: shows the studio and its takes to browsers.
#include <spdlog/spdlog.h>
#include <unistd.h>

#include "base/error.h"
#include "daemon/control/operator_client.h"
#include "daemon/node/daemon_main.h"
#include "daemon/node/service.h"
#include "daemon/viewd/bus_relay.h"
#include "daemon/viewd/command_endpoint.h"
#include "daemon/viewd/command_runner.h"
#include "daemon/viewd/live_feed.h"
#include "daemon/viewd/page_files.h"
#include "daemon/viewd/studio_status.h"
#include "daemon/viewd/web_server.h"
#include "daemon/viewd/web_site.h"

namespace {

constexpr v3d::Duration kLook = std::chrono::milliseconds(20);
/// Who stops all processes of a service tells one before the other.
constexpr v3d::Duration kStopArrivesWithin = std::chrono::seconds(1);
constexpr char kHear[] = "--hear";

std::string token_of(const v3d::Studio& studio, const v3d::WebAddress& address) {
  if (!studio.viewer.token.empty()) return v3d::load_web_token(studio.viewer.token, "viewer.token");
  if (address.is_loopback()) return "";
  throw v3d::InputError(studio.path.string() + ": viewer.listen: " + studio.viewer.listen +
                        " is open to the network, so it wants viewer.token, a file with a token "
                        "that browsers must show; or 127.0.0.1 for this PC alone");
}

/// What the server's thread works with.
struct Served {
  v3d::LiveFeed& feed;
  v3d::StudioStatus& board;
  v3d::CommandEndpoint& desk;
};

/// Brings orders to who carries them out, and what came of them to who watches.
void turn(Served served, v3d::CommandRunner& runner, v3d::MonotonicInstant now) {
  if (const auto end = runner.poll(now)) served.desk.finish(*end);
  if (const auto order = served.desk.next()) runner.begin(*order, now);
  while (const auto event = served.desk.next_event()) served.board.hear(*event);
  served.board.set_order(served.desk.last());
}

/// Where a message belongs.
struct Take {
  Served served;
  v3d::MonotonicInstant now;
  void operator()(const v3d::NotVerified& heard) const {
    if (!heard.why.empty()) spdlog::warn("not verified: {}", heard.why);
    served.board.set_not_verified(heard.why);
  }
  void operator()(const v3d::MeshMessage& mesh) const { served.feed.add(mesh); }
  void operator()(const v3d::HealthMessage& health) const { served.board.hear(health, now); }
  void operator()(const v3d::EventMessage& event) const { served.board.hear(event); }
  void operator()(const v3d::PreviewMessage& preview) const { served.board.hear(preview); }
};

/// Brings what is heard on the studio's network to who watches.
void listen(v3d::BusRelay& hearing, v3d::WebServer& server, Served served,
            v3d::CommandRunner& runner) {
  hearing.wait(v3d::Monotonic::now() + kLook);
  const v3d::MonotonicInstant now = v3d::Monotonic::now();
  server.run_inside([&](int64_t watchers) {
    while (const auto heard = hearing.next()) std::visit(Take{served, now}, *heard);
    turn(served, runner, now);
    served.board.set_watchers(watchers);
    served.board.turn(now);
  });
}

/// What is heard until the service is to stop: then the one who hears may be gone before us.
void serve(v3d::BusRelay& hearing, v3d::WebServer& server, Served served,
           v3d::CommandRunner& runner) {
  try {
    while (!v3d::stop_requested()) {
      listen(hearing, server, served, runner);
      v3d::Realtime::adopt_step();  // nothing here has to keep the time of before
      v3d::service::feed_watchdog();
    }
  } catch (const v3d::BusRelayEnded&) {
    if (!v3d::stop_requested_by(v3d::Monotonic::now() + kStopArrivesWithin)) throw;
  }
}

void run(const v3d::Studio& studio, const std::string& /*node*/) {
  const v3d::WebAddress address =
      v3d::parse_web_address(studio.viewer.listen, studio.path.string() + ": viewer.listen");
  const std::string token = token_of(studio, address);
  v3d::CommandEndpoint desk(studio, v3d::load_operator_token(studio, token));
  v3d::CommandRunner runner(studio);
  if (desk.is_open()) runner.refuse_without_v3dctl();
  v3d::WebSite site(studio, v3d::WebAccess(token), v3d::find_page_files(studio.viewer.page), desk);
  v3d::BusRelay hearing(studio, kHear);
  v3d::LiveFeed feed;
  v3d::StudioStatus board(studio, v3d::commanded_nodes(studio), "");
  board.set_control(desk.is_open());
  const auto watch = [&](v3d::WebSite::StreamKind kind) {
    return kind == v3d::WebSite::StreamKind::kLive ? feed.watch() : board.watch();
  };
  v3d::WebServer server(address, site, watch);
  const std::string host =
      address.host.find(':') == std::string::npos ? address.host : "[" + address.host + "]";
  spdlog::info("serves http://{}:{}/{}", host, server.port(),
               desk.is_open() ? ", and takes orders" : "");
  v3d::service::ready();
  serve(hearing, server, {feed, board, desk}, runner);
  v3d::service::stopping();
}

void hear(const v3d::Studio& studio, const std::string& /*node*/) {
  v3d::tell_what_is_heard(studio, STDOUT_FILENO);
}

}  // namespace

int main(int argc, char** argv) {
  return v3d::daemon_main(
      argc, argv,
      {.name = "v3d-viewd",
       .purpose = "Shows a studio and its takes to browsers.",
       .is_a_node = false,
       .one_shot =
           v3d::DaemonOneShot{.flag = kHear,
                              .purpose = "Tell on standard output what is heard on the studio's "
                                         "network: v3d-viewd starts itself so",
                              .run = hear}},
      run);
}
