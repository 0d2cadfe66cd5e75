#include "injected_studio.h"

#include <algorithm>
#include <csignal>
#include <functional>
#include <stdexcept>

#include "base/io/file.h"
#include "wire/signatures.h"

namespace v3d::test {
namespace {

namespace fs = std::filesystem;

constexpr int kPlates = 4;
const std::string kTake = "kendo-07";
const std::string kBin = V3D_BIN;

void replace(std::string& text, const std::string& before, const std::string& after) {
  const size_t at = text.find(before);
  if (at == std::string::npos) throw std::runtime_error("no " + before + " in the studio file");
  text.replace(at, before.size(), after);
}

std::string node_with_fault(DaemonOperation operation) {
  if (operation == DaemonOperation::kReconstruct) return "recon01";
  return operation == DaemonOperation::kRecord ? "cap01" : "cap02";
}

/// Number of frames or meshes that the daemon reports as written.
int64_t written_in(const wire::HealthMessage& health) {
  const auto value = [&](const char* name) {
    const auto found = health.values.find(name);
    return found == health.values.end() ? 0 : static_cast<int64_t>(found->second);
  };
  return value("frames_written") + std::max<int64_t>(0, value("meshes") - value("write_errors"));
}

}  // namespace

// --- setting up ---------------------------------------------------------------------------------

InjectedStudio::InjectedStudio(DaemonOperation operation)
    : operation_(operation),
      node_(node_with_fault(operation)),
      home_(operation == DaemonOperation::kRejoin ? folder_ / "cap02" : folder_.path()) {
  start_simulator();
  write_studio_files();
  studio_ = load_studio(home_ / "studio.toml");
  start_others();
  start_injected({});
  client_ = std::make_unique<control::OperatorClient>(studio_);
  learn_background();
  end_injected();
}

void InjectedStudio::start_simulator() {
  const std::string cameras = operation_ == DaemonOperation::kReconstruct ? "3" : "1";
  simulator_.emplace(
      std::vector<std::string>{kBin + "/v3d-sim", "studio", folder_.path(), "--cameras", cameras,
                               "--size", "96x72", "--rate", "8", "--loop-frames", "5",
                               "--empty-pulses", std::to_string(kPlates), "--voxel", "100mm"},
      folder_ / "v3d-sim.log");
  const auto serves = [&] { return simulator_->output().find("ready\n") != std::string::npos; };
  if (!becomes_true(serves, within(60))) throw std::runtime_error(simulator_->output());
}

/// Adds the signing keys and, to rejoin, the node cap02.
void InjectedStudio::write_studio_files() {
  std::string text = read_file(folder_ / "studio.toml");
  replace(text, "takes = \".\"", "takes = \"takes\"");
  fs::create_directories(home_ / "takes");
  if (operation_ != DaemonOperation::kReconstruct) {
    const wire::SigningKey key = wire::SigningKey::make();
    key.save(home_ / "node.key");
    replace(text, "[storage]", "[storage]\nsigning_key = \"node.key\"");
  }
  if (operation_ == DaemonOperation::kRejoin) {
    replace(text, "[camera_defaults]\nnode = \"cap01\"",
            "[[node]]\nname = \"cap02\"\n\n[camera_defaults]\nnode = \"cap02\"");
    for (const char* file : {"trigger.sock", "studio.key", "calib.toml"}) {
      replace(text, "\"" + std::string(file) + "\"", "\"" + (folder_ / file).string() + "\"");
    }
    wire::SigningKey::make().save(folder_ / "node.key");
    fs::create_directories(folder_ / "takes");
    write_text(folder_ / "studio.toml", text);
  }
  write_text(home_ / "studio.toml", text);
}

void InjectedStudio::start_others() {
  const auto start = [&](const std::string& program, const std::string& node) {
    others_.push_back(std::make_unique<ChildProcess>(
        std::vector<std::string>{kBin + "/" + program, "--studio", folder_ / "studio.toml",
                                 "--node", node},
        folder_ / (node + ".log")));
  };
  if (operation_ != DaemonOperation::kRecord) start("v3d-captured", "cap01");
  if (operation_ != DaemonOperation::kReconstruct) start("v3d-recond", "recon01");
}

void InjectedStudio::learn_background() {
  const control::Answer learnt = command(wire::CommandVerb::kBackground, kPlates);
  if (!learnt.done()) throw std::runtime_error("background: " + run_.program.err);
}

void InjectedStudio::start_injected(const std::vector<std::string>& variables) {
  const bool captures = operation_ != DaemonOperation::kReconstruct;
  std::vector<std::string> line = {"/usr/bin/env"};
  line.insert(line.end(), variables.begin(), variables.end());
  line.insert(line.end(), {kBin + (captures ? "/v3d-captured" : "/v3d-recond"), "--studio",
                           home_ / "studio.toml", "--node", node_});
  fs::remove(folder_ / "injected.log");
  injected_.emplace(line, folder_ / "injected.log");
}

// --- a run --------------------------------------------------------------------------------------

DaemonRun InjectedStudio::run(const Fault& fault) {
  run_ = {};
  health_.clear();
  for (const fs::path& folder : {home_, folder_.path()}) fs::remove_all(folder / "takes" / kTake);
  client_ = std::make_unique<control::OperatorClient>(studio_);
  const MappedReport report(folder_ / "report");
  std::vector<std::string> variables = injector_variables(home_, folder_ / "report");
  std::ranges::move(variables_of(fault), std::back_inserter(variables));
  if (operation_ == DaemonOperation::kRejoin) record_until_killed();
  health_.clear();
  start_injected(variables);
  run_.was_ready = await([&] { return health_.contains(node_); }, 20) && injected_->runs();
  if (operation_ == DaemonOperation::kRejoin) {
    const auto records = [&] { return state_of(node_) == wire::NodeState::kRecording; };
    const auto has_failed = [&] {
      return injected_->output().find("cannot rejoin the running take") != std::string::npos;
    };
    await([&] { return records() || has_failed(); }, 20);
    run_.is_done = run_.is_done && records();
  } else if (run_.was_ready) {
    record();
  }
  stop();
  end_injected();
  report.read(run_.program);
  return std::move(run_);
}

/// Starts a take without a fault, and kills the daemon when its health reports frames.
void InjectedStudio::record_until_killed() {
  start_injected({});
  run_.is_done =
      command(wire::CommandVerb::kArm).done() && command(wire::CommandVerb::kStart).done();
  if (!run_.is_done) throw std::runtime_error("arm and start: " + run_.program.err);
  if (!await([&] { return run_.acknowledged > 0; }, 20)) throw std::runtime_error("no frames");
  injected_->signal(SIGKILL);
  injected_->wait(within(10));
  client_ =
      std::make_unique<control::OperatorClient>(studio_);  // forgets health from before the kill
}

void InjectedStudio::record() {
  run_.is_done = command(wire::CommandVerb::kArm, kInjectedPulses).done();
  if (!run_.is_done) return;
  run_.is_done = command(wire::CommandVerb::kStart).done();
  const auto is_over = [&] {
    return std::ranges::all_of(client_->nodes(), [&](const std::string& node) {
      return state_of(node) == wire::NodeState::kIdle || state_of(node) == wire::NodeState::kFault;
    });
  };
  if (run_.is_done) await(is_over, 25);
}

void InjectedStudio::stop() {
  run_.stopped = command(wire::CommandVerb::kStop);
  run_.is_done = run_.is_done && run_.stopped.done();
  if (!run_.stopped.done()) command(wire::CommandVerb::kAbort);
}

void InjectedStudio::end_injected() {
  collect_reports();
  run_.ended_itself = !injected_->runs();
  injected_->signal(SIGTERM);
  run_.program.status = injected_->wait(within(25)).value_or(-1);
  collect_reports();
  run_.program.out = injected_->output();
  injected_.reset();
}

take::TakePaths InjectedStudio::take() const { return {studio_.storage.takes / kTake}; }

// --- commands and reports -----------------------------------------------------------------------

/// Waits less when the daemon has ended, or cannot read the studio key: it does not answer.
control::Answer InjectedStudio::command(wire::CommandVerb verb, int64_t pulses) {
  wire::CommandMessage order;
  order.verb = verb;
  order.take = verb == wire::CommandVerb::kBackground ? "" : kTake;
  order.pulses = pulses;
  const bool may_answer =
      injected_->runs() &&
      injected_->output().find("every command is rejected") == std::string::npos;
  control::Answer answer = client_->command(order, within(may_answer ? 25 : 1));
  for (const auto& [node, reply] : answer.replies) {
    run_.program.err += node + ": " + reply.text + "\n";
  }
  for (const std::string& node : answer.silent) run_.program.err += node + " is silent\n";
  health_.clear();
  collect_reports();
  return answer;
}

void InjectedStudio::collect_reports() {
  while (const auto event = client_->next_event(Monotonic::now())) {
    run_.program.err += "event: " + event->text + "\n";
  }
  for (const auto& [node, health] : client_->health(Monotonic::now())) {
    health_[node] = health;
    if (node != node_ || health.take != kTake) continue;
    run_.acknowledged = std::max(run_.acknowledged, written_in(health));
  }
}

bool InjectedStudio::await(const std::function<bool()>& condition, int seconds) {
  const auto is_over = [&] {
    collect_reports();
    return condition() || !injected_->runs();
  };
  return becomes_true(is_over, within(seconds));
}

wire::NodeState InjectedStudio::state_of(const std::string& node) {
  const auto health = health_.find(node);
  return health == health_.end() ? wire::NodeState::kDraining : health->second.state;
}

}  // namespace v3d::test
