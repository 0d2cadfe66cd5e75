// Fuzz target: text for the operator from replies and health messages. Senders may choose any text,
// which is made printable on receipt. A detail that is no valid JSON is reported as unreadable.
#include <nlohmann/json.hpp>

#include "base/core/text.h"
#include "fuzz_input.h"
#include "v3dctl/operate/camera_report.h"
#include "v3dctl/operate/health_text.h"
#include "v3dctl/operate/reply_text.h"
#include "v3dctl/operate/studio_monitor.h"

namespace {

using v3d::test::FuzzInput;

const std::vector<std::string> kNodes = {"cap01", "cap02"};

void read_replies(const std::string& text, const std::string& detail) {
  v3d::control::Answer answer;
  v3d::wire::ReplyMessage& reply = answer.replies["cap01"];
  reply.outcome = v3d::wire::ReplyMessage::Outcome::kDone;
  reply.text = v3d::printable(text);
  reply.detail = detail;
  answer.replies["cap02"] = reply;
  v3d::ctl::reply_lines(kNodes, answer, "ready");
  v3d::ctl::answer_json(answer).dump();
  const v3d::ctl::TakeAccount account = v3d::ctl::merge_ledgers(answer, {"cam01"});
  account.ledger.verdict();
  v3d::ctl::live_loss_line(account);
  v3d::ctl::to_json(account.ledger).dump();
  const v3d::ctl::CheckReport report = v3d::ctl::parse_check_replies(answer);
  v3d::ctl::check_lines(report.cameras);
  v3d::ctl::sound_lines(report.sounds);
  v3d::ctl::check_json(report).dump();
}

void read_health(FuzzInput& input) {
  v3d::ctl::StudioSnapshot state;
  state.studio = "dojo";
  state.nodes = kNodes;
  state.cameras["cap01"] = {"cam01", "cam02"};
  v3d::wire::HealthMessage& health = state.health["cap01"];
  health.state = static_cast<v3d::wire::NodeState>(1 + input.number<uint8_t>() % 5);
  health.text = v3d::printable(input.text());
  while (!input.empty()) {
    const std::string name = v3d::printable(input.text());
    health.values[name] = input.number<double>();
  }
  v3d::ctl::health_lines(kNodes, state.health);
  v3d::ctl::health_json(kNodes, state.health).dump();
  v3d::ctl::status_lines(kNodes, state.health);
  v3d::ctl::recording_line(state.health);
  for (const auto& line : v3d::ctl::watch_lines(state, 80, 24)) line.text(true);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  FuzzInput input(data, size);
  if (input.number<uint8_t>() % 2 == 0) {
    const std::string text = input.text();
    read_replies(text, input.rest());
  } else {
    read_health(input);
  }
  return 0;
}
