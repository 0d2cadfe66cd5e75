#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "base/core/error.h"
#include "base/io/file.h"
#include "daemon/control/operator_client.h"
#include "v3dctl/command_line.h"
#include "v3dctl/operate/studio_monitor.h"
#include "v3dctl/options.h"
#include "v3dctl/setup/doctor.h"
#include "v3dctl/setup/node_settings.h"
#include "wire/secret_keys.h"

namespace v3d::ctl {
namespace {

using Json = nlohmann::ordered_json;
using Verdict = Finding::Verdict;

const char* verdict_name(Verdict verdict) {
  return verdict == Verdict::kGood ? "good" : verdict == Verdict::kBad ? "bad" : "unknown";
}

void print_text(const std::vector<Finding>& findings) {
  for (const Finding& finding : findings) {
    std::printf("%-8s %-16s %s\n", verdict_name(finding.verdict), finding.subject.c_str(),
                finding.text.c_str());
    if (!finding.remedy.empty()) std::printf("%26sTry: %s\n", "", finding.remedy.c_str());
  }
}

void print_json(const std::vector<Finding>& findings) {
  Json list = Json::array();
  for (const Finding& finding : findings) {
    Json json = {{"verdict", verdict_name(finding.verdict)},
                 {"subject", finding.subject},
                 {"text", finding.text},
                 {"remedy", finding.remedy}};
    for (const auto& [name, value] : finding.values) json[name] = value;
    list.push_back(json);
  }
  std::printf("%s\n", Json({{"findings", list}}).dump(2).c_str());
}

void require_node(const Studio& studio, const std::string& node) {
  const bool known =
      std::any_of(studio.nodes.begin(), studio.nodes.end(),
                  [&](const StudioNode& candidate) { return candidate.name == node; });
  if (!node.empty() && !known)
    throw InputError("doctor " + node + ": no such node in " + studio.path.string());
}

/// Nodes send health once a second; the first message of a node is not accepted
/// (ChannelKind::needs_challenge).
constexpr Duration kListen = std::chrono::seconds(3);

/// Findings about all nodes. Receives health for up to three seconds.
std::vector<Finding> check_all_nodes(const Studio& studio) {
  control::OperatorClient client(studio);
  report_if_not_verified(client);
  return check_nodes(client.nodes(), client.health(Monotonic::now() + kListen));
}

/// `node`: checks only its cameras; empty: all cameras of the studio. Takes up to 15 s.
std::vector<Finding> check_all(const Studio& studio, const std::string& node) {
  const std::vector<StudioCamera> cameras = node.empty() ? studio.cameras : studio.cameras_of(node);
  std::vector<Finding> findings = check_network(studio, cameras);
  findings.push_back(check_clock());
  const std::vector<Finding> sounds = check_sound_devices(studio, node);
  findings.insert(findings.end(), sounds.begin(), sounds.end());
  if (const auto lights = check_lights(studio, node)) findings.push_back(*lights);
  for (const auto& more : {check_machine(studio, node), examine_keys(studio)}) {
    findings.insert(findings.end(), more.begin(), more.end());
  }
  if (node.empty() || node == studio.trigger.node) {
    const std::vector<Finding> scale = check_ptp_scale(studio.trigger);
    findings.insert(findings.end(), scale.begin(), scale.end());
  }
  // Where the trigger may be. Alone, so that the other checks do not delay its thread.
  if (node.empty() || node == studio.trigger.node) {
    findings.push_back(check_wakeups(studio, !node.empty()));
  }
  return findings;
}

}  // namespace

void add_doctor(CommandLine& line) {
  cli::Command command = line.add("doctor", "Check the requirements of this PC and print remedies",
                                  {"v3dctl doctor", "v3dctl doctor cap07", "v3dctl doctor --all"});
  struct Arguments {
    std::string node;
    bool all = false;
    bool json = false;
  };
  auto arguments = std::make_shared<Arguments>();
  command.add_option("NODE", arguments->node, "Check only the cameras of this node");
  command.add_flag("--all", arguments->all, "Check all nodes instead, from the health they send");
  add_json_flag(command, arguments->json);
  line.on_run(command, [&line, arguments]() -> int {
    const Studio studio = line.studio();
    require_node(studio, arguments->node);
    if (arguments->all && !arguments->node.empty()) {
      throw InputError("doctor: give NODE or --all");
    }
    const std::vector<Finding> findings =
        arguments->all ? check_all_nodes(studio) : check_all(studio, arguments->node);
    if (arguments->json) {
      print_json(findings);
    } else {
      print_text(findings);
    }
    const bool bad = std::any_of(findings.begin(), findings.end(), [](const Finding& finding) {
      return finding.verdict == Verdict::kBad;
    });
    return bad ? kExitIncomplete : kExitDone;
  });
}

Finding check_key_file(const std::filesystem::path& key) {
  const auto file = io::File::open(key, io::OpenMode::kRead);
  if (!file && file.error().code == EACCES) {
    return {Verdict::kUnknown, "studio key", file.error().message,
            "run v3dctl doctor as a member of the group v3d, or as root"};
  }
  try {
    wire::StudioKey::load(key);
    return {Verdict::kGood, "studio key", key.string() + " exists, and other users cannot read it",
            ""};
  } catch (const InputError& error) {
    const std::string text = error.what();
    const bool others = file && text.find("chmod") != std::string::npos;
    return {Verdict::kBad, "studio key", text,
            others ? "chmod 640 " + key.string()
                   : "copy the file from another PC; v3dctl key new makes the first one"};
  }
}

Finding check_member_list(const Studio& studio) {
  try {
    const wire::MemberList list = load_member_list(studio);
    return {Verdict::kGood, "member list",
            studio.network.members.string() + ", serial number " + std::to_string(list.serial) +
                ", is signed by the authority",
            ""};
  } catch (const InputError& error) {
    return {Verdict::kBad, "member list", error.what(),
            "copy the file from another PC; v3dctl key enroll makes the first one"};
  }
}

std::vector<Finding> check_keys_of(const std::vector<std::string>& nodes,
                                   const std::map<std::string, wire::HealthMessage>& health) {
  std::vector<Finding> findings;
  for (const std::string& node : nodes) {
    const std::string subject = "key of " + node;
    const auto message = health.find(node);
    if (message == health.end()) {
      findings.push_back(
          {Verdict::kUnknown, subject, "no health message received; check that the PC is on", ""});
    } else if (control::is_verified(message->second)) {
      findings.push_back({Verdict::kGood, subject, "the same key as on this PC", ""});
    } else {
      findings.push_back({Verdict::kBad, subject, "no key, or a different key",
                          "copy the studio key of this PC to that PC"});
    }
  }
  return findings;
}

std::vector<Finding> examine_keys(const Studio& studio) {
  std::vector<Finding> findings = {check_key_file(studio.network.key)};
  if (!studio.network.members.empty()) findings.push_back(check_member_list(studio));
  if (findings.front().verdict != Verdict::kGood) return findings;
  try {
    control::OperatorClient client(studio);
    const auto health = client.health(Monotonic::now() + kListen);
    const auto more = check_keys_of(client.nodes(), health);
    findings.insert(findings.end(), more.begin(), more.end());
  } catch (const InputError& error) {
    findings.push_back({Verdict::kUnknown, "key of others", error.what(), ""});
  }
  return findings;
}

}  // namespace v3d::ctl
