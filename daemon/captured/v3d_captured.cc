// v3d-captured: daemon of a capture node, which runs its cameras and its trigger.
#include <spdlog/spdlog.h>

#include "base/core/error.h"
#include "daemon/captured/capture_node.h"
#include "daemon/control/reply_json.h"
#include "daemon/node/node_loop.h"
#include "daemon/node/persisted_command.h"
#include "daemon/node/service.h"
#include "daemon/node/take_folder.h"
#include "trigger/pulse_generator.h"

namespace {

/// Ledgers of the takes that this node recorded before the restart: those recovered just now, and
/// those that the daemon closed in order when it ended, even while pulses still ran.
std::vector<v3d::take::Ledger> accounts(const v3d::Studio& studio, const std::string& node,
                                        const std::vector<v3d::node::RecoveredTake>& recovered) {
  std::vector<v3d::take::Ledger> ledgers;
  for (const v3d::node::RecoveredTake& take : recovered) {
    if (take.ledger) ledgers.push_back(*take.ledger);
  }
  for (const auto& [take, command] : v3d::node::persisted_commands(studio, node).commands) {
    const v3d::take::TakePaths paths = v3d::node::take_paths(studio, take);
    try {
      // The ledger of an open take is of an earlier recovery, or lacks what was not written.
      if (v3d::take::load_take_info(paths).state == v3d::take::TakeState::kRecording) continue;
      ledgers.push_back(v3d::take::load_ledger(paths.ledger()));
    } catch (const v3d::InputError&) {  // armed, but never closed
    }
  }
  return ledgers;
}

void run(const v3d::Studio& studio, const std::string& node) {
  std::vector<std::string> cameras;
  for (const v3d::StudioCamera& camera : studio.cameras_of(node)) cameras.push_back(camera.name);
  v3d::node::service::status("recovering open takes");
  const std::vector<v3d::node::RecoveredTake> recovered =
      v3d::node::recover_open_takes(studio, node, cameras);
  for (const v3d::node::RecoveredTake& take : recovered) spdlog::warn("{}", take.line);
  const std::string problem = v3d::bus::receive_buffer_problem(studio.network.lcm_url);
  if (!problem.empty()) spdlog::warn("{}", problem);
  v3d::bus::Bus bus(studio.network.lcm_url, studio.network.frame_groups,
                    v3d::bus::ChannelList(studio));
  bus.authenticator().require_authentication();
  v3d::captured::CaptureNode capture(studio, node, bus);
  for (const v3d::node::RecoveredTake& take : recovered) {
    if (!take.ledger) capture.report_open_take(take.line);
  }
  v3d::node::NodeLoop loop(
      {node, "v3d-captured", v3d::bus::credentials_of_node(studio, node), studio.network.metrics},
      bus, capture);
  for (const v3d::take::Ledger& ledger : accounts(studio, node, recovered)) {
    loop.set_last_result(ledger.take, "recovered " + ledger.verdict(),
                         v3d::control::ledger_detail(ledger));
  }
  loop.run();
}

/// Turns the trigger output off (--trigger-off): run by systemd however the daemon ended, so that
/// no pulses continue.
void trigger_off(const v3d::Studio& studio, const std::string& node) {
  if (studio.trigger.node != node) return;
  v3d::trigger::make_generator(studio.trigger)->silence();
  spdlog::info("the trigger's output is inactive");
}

}  // namespace

int main(int argc, char** argv) {
  return v3d::node::daemon_main(
      argc, argv,
      {.name = "v3d-captured",
       .purpose = "Runs the cameras and the trigger of one node of a studio.",
       .one_shot = v3d::node::DaemonOneShot{.flag = "--trigger-off",
                                            .purpose = "only turns the trigger's output off",
                                            .run = trigger_off}},
      run);
}
