#include "v3dctl/setup/update.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <utility>

#include "base/core/error.h"
#include "base/core/text.h"
#include "common/console.h"
#include "wire/secret_keys.h"

namespace v3d::ctl {
namespace {

using Health = std::map<std::string, wire::HealthMessage>;

/// A request is repeated after this time until there is a report on it.
constexpr Duration kRequestPeriod = std::chrono::seconds(30);
/// Slot in health that names none. It differs from every slot.
constexpr double kUnknownSlot = 0;

constexpr std::array<std::pair<std::string_view, InstallReport::State>, 6> kReportStates = {{
    {"checking", InstallReport::State::kChecking},
    {"installing", InstallReport::State::kInstalling},
    {"waiting", InstallReport::State::kWaiting},
    {"restarting", InstallReport::State::kRestarting},
    {"refused", InstallReport::State::kRefused},
    {"failed", InstallReport::State::kFailed},
}};

/// A string field, without line breaks and other control characters; empty where there is none.
std::string text_field(const nlohmann::json& object, const char* key) {
  const auto field = object.find(key);
  if (field == object.end() || !field->is_string()) return "";
  return printable(field->get_ref<const std::string&>());
}

/// What the node does with a take: "is armed"; empty where it has none. A node that is being armed
/// is idle, with the name of its take.
std::string take_state(const wire::HealthMessage& health) {
  switch (health.state) {
    case wire::NodeState::kArmed:
    case wire::NodeState::kRecording:
    case wire::NodeState::kDraining:
      return "is " + std::string(name(health.state));
    case wire::NodeState::kIdle:
      return health.take.empty() ? "" : "is being armed";
    case wire::NodeState::kFault:
      break;
  }
  return "";
}

/// The node, state and name of a take that is being armed, armed, recorded or closed; empty where
/// there is none.
std::string active_take(const Health& health) {
  for (const auto& [node, message] : health) {
    const std::string state = take_state(message);
    if (state.empty()) continue;
    return node + " " + state + " for take " + printable(message.take) +
           "; update when v3dctl stop has closed it";
  }
  return "";
}

double value_of(const wire::HealthMessage& health, const std::string& value, double otherwise) {
  const auto found = health.values.find(value);
  return found == health.values.end() ? otherwise : found->second;
}

/// Version of the appliance's system: behind the '+' of the program's version.
std::string system_of(const wire::HealthMessage& health) {
  const size_t plus = health.version.find('+');
  return plus == std::string::npos ? "" : health.version.substr(plus + 1);
}

void require_other_pcs(const UpdateRequest& request, const Health& health) {
  const auto own = health.find(request.host);
  if (own == health.end() || system_of(own->second).empty()) return;
  if (std::ranges::find(request.nodes, request.host) == request.nodes.end()) return;
  throw InputError(
      "update: " + request.host +
      " is this PC, whose restart would end the command; run it on another PC, or name "
      "the other nodes with --node");
}

class NodeUpdate {
 public:
  NodeUpdate(const UpdateRequest& request, UpdateLink& link, std::string node)
      : request_(request), link_(link) {
    result_.node = std::move(node);
  }

  UpdatedNode run() {
    const Health health = link_.health();
    if (!health.contains(result_.node)) {
      end(UpdatedNode::State::kSilent, "it sends no health; is the PC on?");
      return result_;
    }
    if (system_of(health.at(result_.node)).empty()) {
      end(UpdatedNode::State::kOtherSystem, "its PC is not the appliance; use apt there");
      return result_;
    }
    if (value_of(health.at(result_.node), "slot_trial_flag", 0) != 0) {
      end(UpdatedNode::State::kRefused,
          "its system is on trial; repeat the update when v3dctl health shows slot_trial_flag no");
      return result_;
    }
    if (const std::string take = active_take(health); !take.empty()) {
      end(UpdatedNode::State::kRefused, take);
      return result_;
    }
    boots_ = value_of(health.at(result_.node), "boot_count", -1);
    slot_ = value_of(health.at(result_.node), "slot_number", slot_);
    try {
      link_.send_bundle(result_.node, request_.bundle);
      stop_if_interrupted();
      install();
    } catch (const std::runtime_error& error) {
      end(UpdatedNode::State::kFailed, error.what());
    }
    return result_;
  }

 private:
  void end(UpdatedNode::State state, std::string message = "") {
    result_.state = state;
    result_.message = std::move(message);
  }

  void install() {
    link_.send_request(result_.node, number_);
    MonotonicInstant now = link_.wait();
    const MonotonicInstant deadline = now + request_.timeout;
    next_request_ = now + kRequestPeriod;
    while ((now = link_.wait()) < deadline) {
      if (interrupted()) {
        throw std::runtime_error("interrupted; " +
                                 (waits_for_.empty() ? "the PC continues" : wait_text()) +
                                 ": v3dctl health shows its version");
      }
      if (read_report() || read_health()) return;
      if (!has_report_ && now >= next_request_) repeat_request(now);
    }
    end(UpdatedNode::State::kFailed, timeout_text());
  }

  std::string wait_text() const {
    return "the update is installed, and the PC restarts when no take is armed or recorded (" +
           waits_for_ + ")";
  }
  std::string timeout_text() {
    if (is_restarting_) {
      const std::string problem = problem_of_new_system();
      return "it does not report after the restart" + (problem.empty() ? "" : "; " + problem) +
             "; systemctl status 'v3d-*' there";
    }
    if (!waits_for_.empty()) return wait_text();
    return "the installation does not end; systemctl status v3d-update there";
  }

  /// Why the new system ended its trial. Empty where it did not report it: its kernel did not
  /// start, or the PC does not reply.
  std::string problem_of_new_system() {
    if (problem_.empty()) {
      const auto report = parse_install_report(link_.install_report(result_.node), number_);
      if (report) problem_ = report->message;
    }
    return problem_.empty() ? "" : "the new system did not start well: " + problem_;
  }

  /// A PC that loses its power may lose a request, too. Its number makes the PC obey it once.
  void repeat_request(MonotonicInstant now) {
    next_request_ = now + kRequestPeriod;
    try {
      link_.send_request(result_.node, number_);
    } catch (const std::runtime_error&) {
      // The PC starts again; the deadline ends the attempts.
    }
  }

  /// True when the report ends the update.
  bool read_report() {
    if (is_restarting_) return false;
    const auto report = parse_install_report(link_.install_report(result_.node), number_);
    if (!report) return false;
    has_report_ = true;
    if (!report->version.empty()) result_.version = report->version;
    is_restarting_ = report->state == InstallReport::State::kRestarting;
    if (is_restarting_) problem_ = report->message;
    read_wait(*report);
    if (report->state == InstallReport::State::kRefused) {
      end(UpdatedNode::State::kRefused, report->message);
    } else if (report->state == InstallReport::State::kFailed) {
      end(UpdatedNode::State::kFailed, report->message);
    } else {
      return false;
    }
    return true;
  }

  void read_wait(const InstallReport& report) {
    std::string waits_for;
    if (report.state == InstallReport::State::kWaiting) waits_for = report.message;
    if (waits_for == waits_for_) return;
    waits_for_ = std::move(waits_for);
    if (!waits_for_.empty()) note(result_.node + ": waits before its restart: " + waits_for_);
  }

  /// True for health of the system that the bundle holds. It runs in the other slot: both slots may
  /// have its version.
  bool is_new_system(const wire::HealthMessage& health) const {
    return !result_.version.empty() && system_of(health) == result_.version &&
           value_of(health, "slot_number", kUnknownSlot) != slot_;
  }

  /// True when the health after the restart of the PC ends the update.
  bool read_health() {
    const Health health = link_.health();
    const auto message = health.find(result_.node);
    if (message == health.end()) return false;
    // The count is missing until the PC has counted its start.
    const double boots = value_of(message->second, "boot_count", boots_);
    if (boots_ < 0) boots_ = boots;
    if (boots == boots_) return false;
    // The PC may have restarted before its report was read. The report then has the version.
    const bool is_new = is_new_system(message->second);
    if (is_new && value_of(message->second, "slot_trial_flag", 1) == 0) {
      end(UpdatedNode::State::kUpdated);
      return true;
    }
    // On trial; or its report is still to be read, and says what interrupted the installation.
    if (is_new || !is_restarting_) return false;
    std::string problem = problem_of_new_system();
    if (problem.empty()) problem = "the new system did not start well";
    end(UpdatedNode::State::kFellBack, problem + "; it runs " +
                                           printable(system_of(message->second)) +
                                           "; journalctl -b -1, as root there, shows more");
    return true;
  }

  const std::string number_ = fmt::format("{:016x}", static_cast<uint64_t>(wire::random_nonce()));
  const UpdateRequest& request_;
  UpdateLink& link_;
  UpdatedNode result_;
  double boots_ = -1;  ///< starts of the PC before the update; -1: unknown
  double slot_ = -1;   ///< that ran before the update; -1: unknown
  bool has_report_ = false;
  bool is_restarting_ = false;
  std::string waits_for_;  ///< before the restart: node, state and take, or empty
  std::string problem_;    ///< of the new system, after its trial
  MonotonicInstant next_request_;
};

}  // namespace

std::optional<InstallReport> parse_install_report(std::string_view json,
                                                  const std::string& request) {
  if (json.size() > kMaxInstallReportBytes) return std::nullopt;
  const nlohmann::json object = nlohmann::json::parse(json, nullptr, false);
  if (!object.is_object() || text_field(object, "request") != request) return std::nullopt;
  const std::string state = text_field(object, "state");
  for (const auto& [text, value] : kReportStates) {
    if (text != state) continue;
    return InstallReport{value, text_field(object, "version"), text_field(object, "message")};
  }
  return std::nullopt;
}

std::string_view name(UpdatedNode::State state) {
  switch (state) {
    case UpdatedNode::State::kUpdated:
      return "updated";
    case UpdatedNode::State::kOtherSystem:
      return "other system";
    case UpdatedNode::State::kRefused:
      return "refused";
    case UpdatedNode::State::kFailed:
      return "failed";
    case UpdatedNode::State::kFellBack:
      return "fell back";
    case UpdatedNode::State::kSilent:
      return "silent";
    case UpdatedNode::State::kNotTried:
      return "not tried";
  }
  return "";
}

std::vector<UpdatedNode> update_nodes(const UpdateRequest& request, UpdateLink& link) {
  require_other_pcs(request, link.health());
  if (const std::string take = active_take(link.health()); !take.empty()) {
    throw std::runtime_error("refused: " + take);
  }
  std::vector<UpdatedNode> nodes;
  bool continues = true;
  for (const std::string& node : request.nodes) {
    if (continues) {
      nodes.push_back(NodeUpdate(request, link, node).run());
    } else {
      nodes.push_back({node, UpdatedNode::State::kNotTried, "", ""});
    }
    const UpdatedNode::State state = nodes.back().state;
    continues = state == UpdatedNode::State::kUpdated ||
                (state == UpdatedNode::State::kOtherSystem && request.skips_other_systems);
  }
  return nodes;
}

}  // namespace v3d::ctl
