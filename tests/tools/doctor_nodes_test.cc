#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "v3dctl/setup/doctor.h"

namespace v3d::ctl {
namespace {

using Verdict = Finding::Verdict;

TEST(Doctor, of_all_nodes_names_the_nodes_that_need_work) {
  wire::HealthMessage good;
  good.node = "cap01";
  good.state = wire::NodeState::kIdle;
  good.version = "1.0.0+7";
  good.values = {{"cameras", 4},
                 {"cameras_streaming", 4},
                 {"disk_free_bytes", 900e9},
                 {"disk_wear_percent", 3},
                 {"clock_synchronised_flag", 1},
                 {"clock_offset_us", -12},
                 {"temperature_max_celsius", 60}};
  std::map<std::string, wire::HealthMessage> health = {{"cap01", good}};
  for (const Finding& finding : check_nodes({"cap01"}, health)) {
    EXPECT_EQ(finding.verdict, Verdict::kGood) << finding.subject << ": " << finding.text;
  }
  wire::HealthMessage& other = health["cap02"] = good;
  other.node = "cap02";
  other.version = "1.0.0+8";
  other.values = {{"cameras", 4},
                  {"cameras_streaming", 3},
                  {"disk_free_bytes", 1e9},
                  {"disk_wear_percent", 97},
                  {"clock_synchronised_flag", 1},
                  {"clock_offset_us", -1200},
                  {"slot_trial_flag", 1}};
  std::vector<std::string> bad;
  for (const Finding& finding : check_nodes({"cap01", "cap02", "cap03"}, health)) {
    if (finding.verdict == Verdict::kGood) continue;
    bad.push_back(finding.subject);
    EXPECT_FALSE(finding.remedy.empty()) << finding.subject;
    EXPECT_EQ(finding.remedy.find("sudo"), std::string::npos) << "the appliance has no sudo";
  }
  EXPECT_EQ(bad,
            (std::vector<std::string>{"cap02 cameras", "cap02 disk space", "cap02 disk wear",
                                      "cap02 clock offset", "cap02 update", "cap03", "versions"}));
}

TEST(Doctor, of_all_nodes_names_an_appliance_that_does_not_know_whether_it_is_on_trial) {
  wire::HealthMessage health;
  health.node = "cap01";
  health.state = wire::NodeState::kIdle;
  health.values["slot_number"] = 2;
  const auto is_update = [](const Finding& finding) { return finding.subject == "cap01 update"; };
  auto findings = check_nodes({"cap01"}, {{"cap01", health}});
  const auto update = std::ranges::find_if(findings, is_update);
  ASSERT_NE(update, findings.end());
  EXPECT_EQ(update->verdict, Verdict::kBad);
  EXPECT_FALSE(update->remedy.empty());
  health.values["slot_trial_flag"] = 0;
  findings = check_nodes({"cap01"}, {{"cap01", health}});
  const auto confirmed = std::ranges::find_if(findings, is_update);
  ASSERT_NE(confirmed, findings.end());
  EXPECT_EQ(confirmed->verdict, Verdict::kGood);
}

TEST(Doctor, of_all_nodes_names_a_node_that_reports_a_problem_without_a_fault) {
  wire::HealthMessage health;
  health.node = "cap01";
  health.state = wire::NodeState::kIdle;
  health.text = "cannot read the free space of /var/lib/v3d/takes: No such file or directory";
  const Finding finding = check_nodes({"cap01"}, {{"cap01", health}}).front();
  EXPECT_EQ(finding.verdict, Verdict::kBad);
  EXPECT_NE(finding.text.find(health.text), std::string::npos) << finding.text;
  EXPECT_FALSE(finding.remedy.empty());
}

TEST(Doctor, of_all_nodes_compares_programs_and_the_systems_of_appliances) {
  const auto verdict = [](const std::vector<std::string>& versions) {
    std::map<std::string, wire::HealthMessage> health;
    for (const std::string& version : versions) {
      health["node" + std::to_string(health.size())].version = version;
    }
    return check_nodes({}, health).back().verdict;
  };
  EXPECT_EQ(verdict({"1.0.0+7", "1.0.0+7", "1.0.0"}), Verdict::kGood) << "one is no appliance";
  EXPECT_EQ(verdict({"1.0.0+7", "1.0.0+8"}), Verdict::kBad);
  EXPECT_EQ(verdict({"1.0.0+7", "1.1.0"}), Verdict::kBad);
  EXPECT_EQ(verdict({"1.0.0", "1.1.0"}), Verdict::kBad);
}

TEST(Doctor, of_all_nodes_compares_no_version_of_a_node_that_is_silent) {
  const auto silent = check_nodes({"cap01", "cap02"}, {});
  ASSERT_EQ(silent.size(), 2U);
  EXPECT_EQ(silent[0].verdict, Verdict::kBad);
  EXPECT_EQ(silent[1].verdict, Verdict::kBad);
  wire::HealthMessage health;
  health.version = "1.0.0";
  const auto text = [&](const std::vector<std::string>& nodes) {
    return check_nodes(nodes, {{"cap01", health}}).back().text;
  };
  EXPECT_EQ(text({"cap01", "cap02"}), "the nodes that reply have the same");
  EXPECT_EQ(text({"cap01"}), "all nodes have the same");
}

TEST(Doctor, of_all_nodes_names_a_clock_of_which_no_service_reports_the_state) {
  const auto of_clock = [](const std::map<std::string, double>& values) {
    wire::HealthMessage health;
    health.node = "cap01";
    health.values = values;
    std::optional<Finding> found;
    for (const Finding& finding : check_nodes({"cap01"}, {{"cap01", health}})) {
      if (finding.subject == "cap01 clock") found = finding;
    }
    return found;
  };
  ASSERT_TRUE(of_clock({}));
  EXPECT_EQ(of_clock({})->verdict, Verdict::kUnknown);
  EXPECT_EQ(of_clock({})->remedy, "v3dctl doctor cap01 there");
  EXPECT_EQ(of_clock({{"clock_synchronised_flag", 1}}).value().verdict, Verdict::kGood);
  EXPECT_EQ(of_clock({{"clock_synchronised_flag", 0}}).value().verdict, Verdict::kBad);
  EXPECT_FALSE(of_clock({{"ptp_steps_removed", 1}}));
}

TEST(Doctor, of_all_nodes_judges_a_clock_that_ptp4l_alone_synchronises) {
  const auto verdict = [](const std::map<std::string, double>& values) {
    wire::HealthMessage health;
    health.node = "cap01";
    health.values = values;
    std::optional<Verdict> found;
    for (const Finding& finding : check_nodes({"cap01"}, {{"cap01", health}})) {
      if (finding.subject == "cap01 clock offset") found = finding.verdict;
    }
    return found;
  };
  EXPECT_EQ(verdict({{"ptp_steps_removed", 1}, {"ptp_offset_us", -4000}}), Verdict::kBad);
  EXPECT_EQ(verdict({{"ptp_steps_removed", 1}, {"ptp_offset_us", 0.3}}), Verdict::kGood);
  EXPECT_FALSE(
      verdict({{"clock_synchronised_flag", 1}, {"ptp_steps_removed", 1}, {"ptp_offset_us", 37e6}}))
      << "chronyd has the clock; ptp4l observes";
}

TEST(Doctor, of_all_nodes_names_two_PTP_masters_of_which_one_has_lost_the_other) {
  const auto masters = [](const std::vector<std::map<std::string, double>>& nodes) {
    std::map<std::string, wire::HealthMessage> health;
    for (const auto& values : nodes) {
      health["cap0" + std::to_string(1 + health.size())].values = values;
    }
    std::string text;
    for (const Finding& finding : check_nodes({}, health)) {
      if (finding.subject == "clock" && finding.verdict == Verdict::kBad) text = finding.text;
    }
    return text;
  };
  const std::map<std::string, double> master = {{"ptp_steps_removed", 0}};
  const std::map<std::string, double> follower = {{"ptp_steps_removed", 1}, {"ptp_offset_us", 1}};
  const std::map<std::string, double> with_chronyd = {{"ptp_steps_removed", 0},
                                                      {"clock_synchronised_flag", 1}};
  EXPECT_EQ(masters({master, follower, master}),
            "cap01 and cap03 are all PTP masters, so their clocks drift apart");
  EXPECT_EQ(masters({with_chronyd, follower, master}),
            "cap01 and cap03 are all PTP masters, so their clocks drift apart");
  EXPECT_EQ(masters({master, follower, follower}), "");
  EXPECT_EQ(masters({with_chronyd, with_chronyd}), "") << "each is the master of its own cameras";
}

TEST(Doctor, of_all_nodes_names_hot_cameras_and_cameras_of_one_model_with_other_firmware) {
  wire::HealthMessage first;
  first.node = "cap01";
  first.values = {{"cam01.temperature_celsius", 75}};
  first.texts = {{"cam01.model", "Maker A"}, {"cam01.firmware", "1.2"}};
  wire::HealthMessage second;
  second.node = "cap02";
  second.values = {{"cam02.temperature_celsius", 60}};
  second.texts = {{"cam02.model", "Maker A"}, {"cam02.firmware", "1.2"}};
  const auto of_subject = [&](const std::string& subject) {
    std::optional<Finding> found;
    for (const Finding& finding :
         check_nodes({"cap01", "cap02"}, {{"cap01", first}, {"cap02", second}})) {
      if (finding.subject == subject) found = finding;
    }
    return found;
  };
  EXPECT_EQ(of_subject("firmware").value().verdict, Verdict::kGood);
  EXPECT_FALSE(of_subject("cam01"));
  first.values["cam01.temperature_celsius"] = 76;
  second.texts["cam02.firmware"] = "1.1";
  EXPECT_EQ(of_subject("cam01").value().text, "the camera has 76 C");
  EXPECT_EQ(of_subject("firmware").value().verdict, Verdict::kBad);
  EXPECT_EQ(of_subject("firmware").value().text, "Maker A: firmware 1.1 on cam02, 1.2 on cam01");
  first.texts.clear();
  second.texts.clear();
  EXPECT_FALSE(of_subject("firmware")) << "no camera reports its firmware";
}

}  // namespace
}  // namespace v3d::ctl
