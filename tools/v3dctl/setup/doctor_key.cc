#include "v3dctl/setup/doctor_key.h"

#include <filesystem>

#include "base/core/error.h"
#include "daemon/control/operator_client.h"
#include "v3dctl/setup/member_list_file.h"
#include "wire/studio_key.h"

namespace v3d::ctl {
namespace {

using Verdict = Finding::Verdict;

/// Nodes send health once a second; the first message of a node is not accepted
/// (ChannelKind::needs_answer).
constexpr Duration kListen = std::chrono::seconds(3);

}  // namespace

Finding check_key_file(const std::filesystem::path& key) {
  try {
    StudioKey::load(key);
    return {Verdict::kGood, "studio key", key.string() + " exists, and other users cannot read it",
            ""};
  } catch (const InputError& error) {
    const std::string text = error.what();
    const bool others = std::filesystem::exists(key) && text.find("chmod") != std::string::npos;
    return {Verdict::kBad, "studio key", text,
            others ? "chmod 640 " + key.string()
                   : "copy the file from another PC; v3dctl key new makes the first one"};
  }
}

Finding check_member_list(const Studio& studio) {
  try {
    const MemberList list = load_member_list(studio);
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
                                   const std::map<std::string, HealthMessage>& health) {
  std::vector<Finding> findings;
  for (const std::string& node : nodes) {
    const std::string subject = "key of " + node;
    const auto message = health.find(node);
    if (message == health.end()) {
      findings.push_back(
          {Verdict::kUnknown, subject, "no health message received; check that the PC is on", ""});
    } else if (is_verified(message->second)) {
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
    OperatorClient client(studio);
    const auto health = client.health(Monotonic::now() + kListen);
    const auto more = check_keys_of(client.nodes(), health);
    findings.insert(findings.end(), more.begin(), more.end());
  } catch (const InputError& error) {
    findings.push_back({Verdict::kUnknown, "key of others", error.what(), ""});
  }
  return findings;
}

}  // namespace v3d::ctl
