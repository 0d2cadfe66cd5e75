#include "v3dctl/setup/update.h"

#include <gtest/gtest.h>

#include <csignal>
#include <cstdlib>
#include <functional>
#include <stdexcept>

#include "base/core/error.h"
#include "common/console.h"

namespace v3d::ctl {
namespace {

using State = UpdatedNode::State;

std::string report(const std::string& request, const std::string& state,
                   const std::string& message = "") {
  return R"({"request": ")" + request + R"(", "state": ")" + state +
         R"(", "version": "2-new", "message": ")" + message + "\"}";
}

/// PCs that install a bundle. Each wait() lets a second pass.
class SimulatedStudio final : public UpdateLink {
 public:
  enum class Pc {
    kUpdates,
    kFallsBack,
    kFallsBackBeforeItsReportIsRead,
    kRefuses,
    kRestartsItsDaemonOnly,
    kHasTheSameSystem,  ///< and restarts its daemon before
    kLosesItsPower,     ///< while it installs the system that it has, and reports it late
    kLosesARequest,
    kNeverReturns,
    kWaits,  ///< for a take that does not end
    kNoAppliance
  };

  void add(const std::string& node, Pc pc) {
    pcs_[node] = pc;
    wire::HealthMessage message;
    message.node = node;
    message.state = wire::NodeState::kIdle;
    message.version = pc == Pc::kNoAppliance ? "1.0.0" : "1.0.0+1-old";
    if (pc == Pc::kHasTheSameSystem || pc == Pc::kLosesItsPower) message.version = "1.0.0+2-new";
    message.values = {
        {"instance", 1}, {"boot_count", 7}, {"slot_number", 1}, {"slot_trial_flag", 0}};
    health_[node] = message;
  }
  wire::HealthMessage& health_of(const std::string& node) { return health_.at(node); }
  const std::vector<std::string>& copied() const { return copied_; }
  const std::vector<std::string>& requests() const { return requests_; }

  std::map<std::string, wire::HealthMessage> health() override { return health_; }
  void send_bundle(const std::string& node, const std::filesystem::path& /*bundle*/) override {
    copied_.push_back(node);
  }
  void send_request(const std::string& node, const std::string& request) override {
    if (is_unreachable_) throw std::runtime_error("rsync to " + node + " ended with status 255");
    requests_.push_back(request);
    if (interrupts_) std::raise(SIGINT);
    if (pcs_.at(node) == Pc::kLosesARequest) {
      if (requests_.size() == 1) return;
      if (requests_.size() == 2) throw std::runtime_error("the PC starts");
    }
    node_ = node;
    request_ = request;
    seconds_ = 0;
  }
  std::string install_report(const std::string& node) override {
    if (seconds_ < 2 || node_.empty()) return report("an earlier request", "refused", "too old");
    if (pcs_.at(node) == Pc::kRefuses) return report(request_, "refused", "no valid signature");
    if (pcs_.at(node) == Pc::kWaits) return report(request_, "waiting", "cap02 armed kendo-02");
    if (pcs_.at(node) == Pc::kLosesItsPower) {
      if (seconds_ < 15) return report(request_, "installing");
      return report(request_, "failed", "the installation was interrupted");
    }
    if (pcs_.at(node) == Pc::kFallsBack && seconds_ >= 15) {
      return report(request_, "restarting", "v3d-captured@cap02.service failed");
    }
    const bool is_late = pcs_.at(node) == Pc::kFallsBackBeforeItsReportIsRead;
    return report(request_, seconds_ < (is_late ? 12 : 5) ? "installing" : "restarting");
  }
  MonotonicInstant wait() override {
    now_ += std::chrono::seconds(1);
    ++seconds_;
    if (!node_.empty()) change_health();
    return now_;
  }
  bool is_unreachable_ = false;
  bool interrupts_ = false;  ///< after the request

 private:
  /// The health of a process that has just started. The first start after an update is that of the
  /// other slot.
  void send_health(const std::string& system, double boots, double trial) {
    wire::HealthMessage& message = health_[node_];
    message.version = "1.0.0+" + system;
    message.values = {{"instance", 1.0 + seconds_},
                      {"boot_count", boots},
                      {"slot_number", boots == 8 ? 2 : 1},
                      {"slot_trial_flag", trial}};
  }
  void change_health() {
    const Pc pc = pcs_.at(node_);
    if (pc == Pc::kRestartsItsDaemonOnly && seconds_ == 4) send_health("1-old", 7, 0);
    if (pc == Pc::kHasTheSameSystem && seconds_ == 4) send_health("2-new", 7, 0);
    if (pc == Pc::kNeverReturns && seconds_ == 8) health_.erase(node_);
    if (pc == Pc::kUpdates || pc == Pc::kRestartsItsDaemonOnly || pc == Pc::kLosesARequest ||
        pc == Pc::kHasTheSameSystem) {
      if (seconds_ == 10) send_health("2-new", 8, 1);
      if (seconds_ == 12) send_health("2-new", 8, 0);
    }
    if (pc == Pc::kLosesItsPower && seconds_ == 10) {
      send_health("2-new", 8, 0);
      health_.at(node_).values["slot_number"] = 1;
    }
    if (pc == Pc::kFallsBack) {
      if (seconds_ == 10) send_health("2-new", 8, 1);
      if (seconds_ == 20) send_health("1-old", 9, 0);
    }
    if (pc == Pc::kFallsBackBeforeItsReportIsRead) {
      if (seconds_ == 6) health_.erase(node_);
      if (seconds_ == 9) send_health("1-old", 7, 0);
      if (seconds_ == 9) health_.at(node_).values.erase("boot_count");  // not counted yet
      if (seconds_ == 10) health_.at(node_).values["boot_count"] = 9;
    }
  }

  std::map<std::string, Pc> pcs_;
  std::map<std::string, wire::HealthMessage> health_;
  std::vector<std::string> copied_, requests_;
  std::string node_, request_;
  int seconds_ = 0;
  MonotonicInstant now_ = Monotonic::now();
};
using Pc = SimulatedStudio::Pc;

class Update : public ::testing::Test {
 protected:
  std::vector<UpdatedNode> update(const std::vector<std::string>& nodes) {
    request_.nodes = nodes;
    return update_nodes(request_, studio_);
  }
  UpdateRequest request_{.bundle = "new.raucb", .nodes = {}, .timeout = std::chrono::seconds(100)};
  SimulatedStudio studio_;
};

TEST_F(Update, of_a_node_is_done_when_the_new_system_has_ended_its_trial) {
  studio_.add("cap01", Pc::kUpdates);
  const auto nodes = update({"cap01"});
  EXPECT_EQ(nodes.at(0).state, State::kUpdated) << nodes.at(0).message;
  EXPECT_EQ(nodes.at(0).version, "2-new");
  EXPECT_EQ(studio_.health_of("cap01").values.at("slot_trial_flag"), 0) << "not before its trial";
}

TEST_F(Update, goes_from_node_to_node_and_stops_at_the_first_that_falls_back) {
  studio_.add("cap01", Pc::kUpdates);
  studio_.add("cap02", Pc::kFallsBack);
  studio_.add("cap03", Pc::kUpdates);
  const auto nodes = update({"cap01", "cap02", "cap03"});
  EXPECT_EQ(nodes.at(0).state, State::kUpdated);
  EXPECT_EQ(nodes.at(1).state, State::kFellBack);
  EXPECT_EQ(nodes.at(1).message,
            "the new system did not start well: v3d-captured@cap02.service failed; it runs 1-old; "
            "journalctl -b -1, as root there, shows more");
  EXPECT_EQ(nodes.at(2).state, State::kNotTried);
  EXPECT_EQ(studio_.copied(), (std::vector<std::string>{"cap01", "cap02"}));
}

TEST_F(Update, falls_back_although_the_old_system_is_seen_before_the_report_of_the_restart) {
  studio_.add("cap01", Pc::kFallsBackBeforeItsReportIsRead);
  const auto nodes = update({"cap01"});
  EXPECT_EQ(nodes.at(0).state, State::kFellBack) << nodes.at(0).message;
}

TEST_F(Update, to_the_same_system_is_not_done_before_the_pc_has_restarted) {
  studio_.add("cap01", Pc::kHasTheSameSystem);
  EXPECT_EQ(update({"cap01"}).at(0).state, State::kUpdated);
  EXPECT_EQ(studio_.health_of("cap01").values.at("boot_count"), 8) << "the daemon restarted only";
}

TEST_F(Update, to_the_same_system_has_failed_when_a_power_cut_interrupted_it) {
  studio_.add("cap01", Pc::kLosesItsPower);
  const auto nodes = update({"cap01"});
  EXPECT_EQ(nodes.at(0).state, State::kFailed) << "the slot before runs, with the same version";
  EXPECT_EQ(nodes.at(0).message, "the installation was interrupted");
}

TEST_F(Update, of_a_pc_that_does_not_name_its_slot_is_done_with_its_version) {
  studio_.add("cap01", Pc::kUpdates);
  studio_.health_of("cap01").values.erase("slot_number");
  EXPECT_EQ(update({"cap01"}).at(0).state, State::kUpdated);
}

TEST_F(Update, of_a_pc_that_has_not_counted_its_start_yet_is_no_fall_back) {
  studio_.add("cap01", Pc::kRestartsItsDaemonOnly);
  studio_.health_of("cap01").values.erase("boot_count");
  EXPECT_EQ(update({"cap01"}).at(0).state, State::kUpdated);
}

TEST_F(Update, is_refused_before_anything_is_copied_while_a_node_has_a_take) {
  studio_.add("cap01", Pc::kUpdates);
  studio_.add("cap02", Pc::kUpdates);
  for (const auto state :
       {wire::NodeState::kArmed, wire::NodeState::kRecording, wire::NodeState::kDraining}) {
    studio_.health_of("cap02").state = state;
    EXPECT_THROW(update({"cap01"}), std::runtime_error);
  }
  studio_.health_of("cap02").state = wire::NodeState::kIdle;
  studio_.health_of("cap02").take = "kendo-02";
  EXPECT_THROW(update({"cap01"}), std::runtime_error) << "the take is being armed";
  EXPECT_TRUE(studio_.copied().empty());
}

TEST_F(Update, says_that_a_pc_waits_for_the_end_of_a_take_and_will_restart) {
  studio_.add("cap01", Pc::kWaits);
  const auto nodes = update({"cap01"});
  EXPECT_EQ(nodes.at(0).state, State::kFailed);
  EXPECT_EQ(nodes.at(0).message,
            "the update is installed, and the PC restarts when no take is armed or recorded "
            "(cap02 armed kendo-02)");
}

TEST_F(Update, is_refused_while_the_system_that_runs_is_on_trial) {
  studio_.add("cap01", Pc::kUpdates);
  studio_.health_of("cap01").values["slot_trial_flag"] = 1;
  EXPECT_EQ(update({"cap01"}).at(0).state, State::kRefused);
  EXPECT_TRUE(studio_.copied().empty());
}

TEST_F(Update, reports_why_a_pc_refuses_a_bundle_and_ignores_earlier_reports) {
  studio_.add("cap01", Pc::kRefuses);
  const auto nodes = update({"cap01"});
  EXPECT_EQ(nodes.at(0).state, State::kRefused);
  EXPECT_EQ(nodes.at(0).message, "no valid signature");
}

TEST_F(Update, does_not_mistake_a_restarted_daemon_for_a_restarted_pc) {
  studio_.add("cap01", Pc::kRestartsItsDaemonOnly);
  EXPECT_EQ(update({"cap01"}).at(0).state, State::kUpdated);
}

TEST_F(Update, repeats_a_request_that_a_pc_lost_until_there_is_a_report_on_it) {
  studio_.add("cap01", Pc::kLosesARequest);
  EXPECT_EQ(update({"cap01"}).at(0).state, State::kUpdated);
  ASSERT_EQ(studio_.requests().size(), 3U);
  EXPECT_EQ(studio_.requests().front(), studio_.requests().back()) << "installed once";
}

TEST_F(Update, fails_when_a_pc_does_not_return) {
  studio_.add("cap01", Pc::kNeverReturns);
  const auto nodes = update({"cap01"});
  EXPECT_EQ(nodes.at(0).state, State::kFailed);
  EXPECT_EQ(nodes.at(0).message,
            "it does not report after the restart; systemctl status 'v3d-*' there");
  EXPECT_EQ(studio_.requests().size(), 1U) << "there is a report on it";
}

TEST_F(Update, copies_nothing_to_silent_nodes_and_other_systems) {
  studio_.add("cap01", Pc::kNoAppliance);
  EXPECT_EQ(update({"cap01"}).at(0).state, State::kOtherSystem);
  EXPECT_EQ(update({"cap09"}).at(0).state, State::kSilent);
  EXPECT_TRUE(studio_.copied().empty());
}

TEST_F(Update, of_all_nodes_continues_behind_a_pc_that_is_no_appliance) {
  studio_.add("recon01", Pc::kNoAppliance);
  studio_.add("cap01", Pc::kUpdates);
  EXPECT_EQ(update({"recon01", "cap01"}).at(1).state, State::kNotTried);
  request_.skips_other_systems = true;
  const auto nodes = update({"recon01", "cap01"});
  EXPECT_EQ(nodes.at(0).state, State::kOtherSystem);
  EXPECT_EQ(nodes.at(1).state, State::kUpdated);
}

TEST_F(Update, is_refused_on_an_appliance_that_it_would_restart) {
  studio_.add("cap01", Pc::kUpdates);
  studio_.add("cap02", Pc::kUpdates);
  studio_.add("recon01", Pc::kNoAppliance);
  request_.host = "cap02";
  EXPECT_THROW(update({"cap01", "cap02"}), InputError);
  EXPECT_TRUE(studio_.copied().empty());
  EXPECT_EQ(update({"cap01"}).at(0).state, State::kUpdated);
  request_.host = "recon01";
  EXPECT_EQ(update({"recon01"}).at(0).state, State::kOtherSystem);
}

TEST_F(Update, that_the_user_interrupts_says_that_the_pc_goes_on) {
  // In a process of its own, which stays interrupted.
  const auto update_and_exit = [this] {
    catch_interrupts();
    studio_.add("cap01", Pc::kUpdates);
    studio_.interrupts_ = true;
    const std::string message = update({"cap01"}).at(0).message;
    std::exit(message == "interrupted; the PC continues: v3dctl health shows its version" ? 0 : 1);
  };
  EXPECT_EXIT(update_and_exit(), ::testing::ExitedWithCode(0), "");
}

TEST_F(Update, reports_a_failed_copy) {
  studio_.add("cap01", Pc::kUpdates);
  studio_.is_unreachable_ = true;
  const auto nodes = update({"cap01"});
  EXPECT_EQ(nodes.at(0).state, State::kFailed);
  EXPECT_EQ(nodes.at(0).message, "rsync to cap01 ended with status 255");
}

TEST(InstallReports, are_rejected_when_damaged_or_of_another_request) {
  EXPECT_TRUE(parse_install_report(report("7", "failed"), "7"));
  EXPECT_FALSE(parse_install_report(report("8", "failed"), "7"));
  EXPECT_FALSE(parse_install_report(report("7", "done"), "7")) << "no such state";
  for (const char* text : {"", "{", "[]", "7", R"({"request": 7, "state": "failed"})"}) {
    EXPECT_FALSE(parse_install_report(text, "7")) << text;
  }
}

TEST(InstallReports, show_control_characters_of_a_message_as_text) {
  const auto parsed = parse_install_report(
      R"({"request": "7", "state": "failed", "message": "a\u001b[2Jb\nc"})", "7");
  ASSERT_TRUE(parsed);
  EXPECT_EQ(parsed->message.find('\033'), std::string::npos);
  EXPECT_EQ(parsed->message.find('\n'), std::string::npos);
}

}  // namespace
}  // namespace v3d::ctl
