// v3d-captured: the cameras and the trigger of one node.
#include <spdlog/spdlog.h>

#include "base/error.h"
#include "daemon/captured/capture_node.h"
#include "daemon/control/reply_json.h"
#include "daemon/node/daemon_main.h"
#include "daemon/node/node_loop.h"
#include "daemon/node/persisted_command.h"
#include "daemon/node/service.h"
#include "daemon/node/take_folder.h"
#include "trigger/make_trigger.h"

namespace {

/// What this node has of takes that it was at when it ended: recovered just now, or closed in order
/// while pulses still ran.
std::vector<v3d::Ledger> accounts(const v3d::Studio& studio, const std::string& node,
                                  const std::vector<v3d::RecoveredTake>& recovered) {
  std::vector<v3d::Ledger> ledgers;
  for (const v3d::RecoveredTake& take : recovered) {
    if (take.ledger) ledgers.push_back(*take.ledger);
  }
  for (const auto& [take, order] : v3d::persisted_commands(studio, node)) {
    try {
      ledgers.push_back(v3d::load_ledger(v3d::take_paths(studio, take).ledger()));
    } catch (const v3d::InputError&) {  // a take that was armed, and never closed
    }
  }
  return ledgers;
}

void run(const v3d::Studio& studio, const std::string& node) {
  std::vector<std::string> cameras;
  for (const v3d::StudioCamera& camera : studio.cameras_of(node)) cameras.push_back(camera.name);
  v3d::service::status("looking for takes that were left open");
  const std::vector<v3d::RecoveredTake> recovered = v3d::recover_open_takes(studio, node, cameras);
  for (const v3d::RecoveredTake& take : recovered) spdlog::warn("{}", take.line);
  const std::string problem = v3d::receive_buffer_problem(studio.network.lcm_url);
  if (!problem.empty()) spdlog::warn("{}", problem);
  v3d::Bus bus(studio.network.lcm_url, studio.network.frame_groups, v3d::ChannelList(studio));
  bus.seal().insist();
  v3d::CaptureNode work(studio, node, bus);
  v3d::NodeLoop loop(
      {node, "v3d-captured", v3d::credentials_of_node(studio, node), studio.network.metrics}, bus,
      work);
  for (const v3d::Ledger& ledger : accounts(studio, node, recovered)) {
    loop.remember(ledger.take, "recovered " + ledger.verdict(), v3d::ledger_json(ledger));
  }
  loop.run();
}

/// Whatever ended the daemon, no pulse goes on.
void trigger_off(const v3d::Studio& studio, const std::string& node) {
  if (studio.trigger.node != node) return;
  v3d::make_generator(studio.trigger)->silence();
  spdlog::info("the trigger's output is inactive");
}

}  // namespace

int main(int argc, char** argv) {
  return v3d::daemon_main(
      argc, argv,
      {.name = "v3d-captured",
       .purpose = "Runs the cameras and the trigger of one node of a studio.",
       .errand = v3d::DaemonErrand{.flag = "--trigger-off",
                                   .purpose = "only turns the trigger's output off",
                                   .run = trigger_off}},
      run);
}
