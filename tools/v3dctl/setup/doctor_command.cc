#include <algorithm>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "base/core/error.h"
#include "v3dctl/command_line.h"
#include "v3dctl/options.h"
#include "v3dctl/setup/doctor.h"
#include "v3dctl/setup/doctor_key.h"

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
    list.push_back({{"verdict", verdict_name(finding.verdict)},
                    {"subject", finding.subject},
                    {"text", finding.text},
                    {"remedy", finding.remedy}});
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

/// `node`: checks only its cameras; empty: all cameras of the studio. Takes up to five seconds.
std::vector<Finding> check_all(const Studio& studio, const std::string& node) {
  const std::vector<StudioCamera> cameras = node.empty() ? studio.cameras : studio.cameras_of(node);
  std::vector<Finding> findings = check_network(studio, cameras);
  findings.push_back(check_clock());
  for (const auto& more : {check_machine(studio, cameras), examine_keys(studio)}) {
    findings.insert(findings.end(), more.begin(), more.end());
  }
  return findings;
}

}  // namespace

void add_doctor(CommandLine& line) {
  CLI::App* command = line.add("doctor", "Check the requirements of this PC and print remedies",
                               {"v3dctl doctor", "v3dctl doctor cap07"});
  struct Arguments {
    std::string node;
    bool json = false;
  };
  auto arguments = std::make_shared<Arguments>();
  command->add_option("NODE", arguments->node, "Check only the cameras of this node");
  add_json_flag(command, arguments->json);
  line.on_run(command, [&line, arguments]() -> int {
    const Studio studio = line.studio();
    require_node(studio, arguments->node);
    const std::vector<Finding> findings = check_all(studio, arguments->node);
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

}  // namespace v3d::ctl
