// Nodes and operators of one studio on a real network, while keys and members change.
#include "daemon/node/node_loop.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <map>
#include <mutex>
#include <thread>

#include "base/io/file.h"
#include "daemon/control/operator_client.h"
#include "support/child_process.h"
#include "support/temporary_folder.h"
#include "wire/messages.h"

namespace v3d::node {
namespace {

using test::becomes_true;
using test::within;

/// A node that keeps the signing keys that it gets and reports `problem`. It needs no time to arm
/// or to drain.
class IdleDelegate : public control::NodeDelegate {
 public:
  explicit IdleDelegate(std::string problem, int cameras)
      : problem_(std::move(problem)), cameras_(cameras) {}
  /// The public keys, oldest first. Any thread.
  std::vector<wire::PublicKey> signing_keys() const {
    const std::scoped_lock lock(mutex_);
    return keys_;
  }

  void set_signing_key(const wire::SigningKey& key) override {
    const std::scoped_lock lock(mutex_);
    keys_.push_back(key.public_key());
  }
  void arm(const wire::CommandMessage&) override {}
  void learn(const wire::CommandMessage&) override {}
  void start() override {}
  void drain() override {}
  void disarm() override {}
  std::optional<control::NodeReport> poll(control::Phase phase) override {
    if (phase == control::Phase::kArming) {
      return control::NodeReport{.event = control::Input::kReady, .text = "ready", .detail = {}};
    }
    if (phase == control::Phase::kDraining) {
      return control::NodeReport{.event = control::Input::kDrained, .text = "done", .detail = {}};
    }
    return std::nullopt;
  }
  void report_health(wire::HealthMessage& health) override {
    health.text = problem_;
    for (int i = 0; i < cameras_; ++i) health.values["cam" + std::to_string(i) + ".losses"] = 1;
  }
  bool progressed_since(MonotonicInstant) const override { return true; }

 private:
  const std::string problem_;
  const int cameras_;
  mutable std::mutex mutex_;
  std::vector<wire::PublicKey> keys_;
};

/// A node with its loop in a thread.
class RunningNode {
 public:
  RunningNode(const Studio& studio, const std::string& node, const std::string& problem = "",
              int cameras = 0)
      : bus_(studio.network.lcm_url, {}, bus::ChannelList(studio)), delegate_(problem, cameras) {
    bus_.authenticator().require_authentication();
    loop_.emplace(NodeIdentity{node, "v3d-test", bus::credentials_of_node(studio, node), ""}, bus_,
                  delegate_);
    thread_ = std::thread([this] {
      while (!stopping_) loop_->run_once();
    });
  }
  ~RunningNode() {
    stopping_ = true;
    thread_.join();
  }
  std::vector<wire::PublicKey> signing_keys() const { return delegate_.signing_keys(); }
  RunningNode(const RunningNode&) = delete;
  RunningNode& operator=(const RunningNode&) = delete;

 private:
  bus::Bus bus_;
  IdleDelegate delegate_;
  std::optional<NodeLoop> loop_;
  std::atomic<bool> stopping_ = false;
  std::thread thread_;
};

class NodeLoops : public testing::Test {
 protected:
  NodeLoops() {
    studio_.name = "kyoto";
    studio_.nodes = {{"cap01"}, {"recon01"}};
    studio_.trigger.node = "cap01";
    studio_.reconstruction.nodes = {"recon01"};
    studio_.network.lcm_url = "udpm://239.255.76.67:7667?ttl=0";
    studio_.network.key = folder_ / "studio.key";
    key_.save(studio_.network.key);
  }
  void start() {
    capture_.emplace(studio_, "cap01");
    recon_.emplace(studio_, "recon01");
  }
  static control::Answer abort(control::OperatorClient& client, MonotonicInstant deadline) {
    wire::CommandMessage command;
    command.verb = wire::CommandVerb::kAbort;
    return client.command(command, deadline);
  }
  static bool accepts_command_of(control::OperatorClient& client) {
    return abort(client, within(60)).done();
  }
  static bool ignores_command_of(control::OperatorClient& client) {
    return abort(client, within(2)).silent.size() == 2;
  }
  /// The health of both nodes. On a busy host they seem to be unverified for a while.
  static std::map<std::string, wire::HealthMessage> verified_health(
      control::OperatorClient& client) {
    std::map<std::string, wire::HealthMessage> health;
    const auto is_verified = [&] {
      health = client.health(within(5));
      return health.size() == 2 && std::ranges::all_of(health, [](const auto& entry) {
               return control::is_verified(entry.second);
             });
    };
    EXPECT_TRUE(becomes_true(is_verified, within(60)));
    return health;
  }

  const test::TemporaryFolder folder_;
  const wire::StudioKey key_ = wire::StudioKey::make();
  Studio studio_;
  std::optional<RunningNode> capture_, recon_;
};

TEST_F(NodeLoops, replace_the_studio_key_without_a_lost_command_or_message) {
  start();
  control::OperatorClient client(studio_);
  ASSERT_TRUE(accepts_command_of(client));
  const wire::StudioKey next = wire::StudioKey::make();
  next.save(folder_ / "next.key");
  std::filesystem::rename(folder_ / "next.key", studio_.network.key);
  bus::Bus renewed(studio_.network.lcm_url, {}, bus::ChannelList(studio_));
  renewed.authenticator().set_key(next);
  bus::Subscription<wire::HealthMessage> capture(renewed, wire::health_channel("cap01"), 16);
  bus::Subscription<wire::HealthMessage> recon(renewed, wire::health_channel("recon01"), 16);
  const auto is_renewed = [&] {
    EXPECT_TRUE(accepts_command_of(client));
    return capture.wait(Monotonic::now()) && recon.wait(Monotonic::now());
  };
  EXPECT_TRUE(becomes_true(is_renewed, within(60)));
  EXPECT_TRUE(accepts_command_of(client));
  control::OperatorClient newcomer(studio_);
  EXPECT_TRUE(accepts_command_of(newcomer));
  for (const auto& [node, health] : verified_health(client)) {
    EXPECT_EQ(health.values.at("messages_forged"), 0) << node;
    EXPECT_EQ(health.values.at("commands_forged"), 0) << node;
  }
}

TEST_F(NodeLoops, report_that_they_drain_even_if_this_takes_no_time) {
  start();
  control::OperatorClient client(studio_);
  bus::Bus bus(studio_.network.lcm_url, {}, bus::ChannelList(studio_));
  bus.authenticator().set_key(key_);
  bus::Subscription<wire::HealthMessage> healths(bus, wire::health_channel("cap01"), 64);
  ASSERT_TRUE(accepts_command_of(client));
  // Health is received once its session has responded to a challenge.
  ASSERT_TRUE(becomes_true([&] { return healths.wait(Monotonic::now()).has_value(); }, within(60)));
  const auto obeys = [&](wire::CommandVerb verb) {
    wire::CommandMessage command;
    command.verb = verb;
    command.take = "kendo-07";
    return client.command(command, within(60)).done();
  };
  ASSERT_TRUE(obeys(wire::CommandVerb::kArm));
  ASSERT_TRUE(obeys(wire::CommandVerb::kStart));
  ASSERT_TRUE(obeys(wire::CommandVerb::kStop));
  const auto drains = [&] {
    const auto health = healths.wait(Monotonic::now());
    return health && health->state == wire::NodeState::kDraining;
  };
  EXPECT_TRUE(becomes_true(drains, within(10)));
}

TEST_F(NodeLoops, send_shortened_health_that_reports_the_omission) {
  capture_.emplace(studio_, "cap01", "", 20'000);
  recon_.emplace(studio_, "recon01");
  control::OperatorClient client(studio_);
  const wire::HealthMessage health = verified_health(client)["cap01"];
  EXPECT_THAT(health.text, testing::HasSubstr("health has no detailed values of the cameras"));
  EXPECT_FALSE(health.values.contains("cam7.losses"));
  EXPECT_TRUE(health.values.contains("messages_forged"));
}

TEST_F(NodeLoops, have_a_flag_while_they_report_a_problem) {
  start();
  control::OperatorClient client(studio_);
  const auto flag = [&] { return client.health(within(5)).at("cap01").values.at("problem_flag"); };
  EXPECT_EQ(flag(), 0);
  const RunningNode other(studio_, "cap01");
  EXPECT_TRUE(becomes_true([&] { return flag() == 1; }, within(60))) << "two nodes of one name";
}

TEST_F(NodeLoops, pass_a_signing_key_that_is_made_or_replaced_to_the_capture_node) {
  studio_.storage.signing_key = folder_ / "node.key";
  start();
  std::vector<wire::PublicKey> made;
  EXPECT_EQ(capture_->signing_keys(), made);
  for (int i = 0; i < 2; ++i) {
    const wire::SigningKey key = wire::SigningKey::make();
    key.save(folder_ / "next.key");
    std::filesystem::rename(folder_ / "next.key", studio_.storage.signing_key);
    made.push_back(key.public_key());
    ASSERT_TRUE(becomes_true([&] { return capture_->signing_keys() == made; }, within(60)));
  }
  EXPECT_THAT(recon_->signing_keys(), testing::IsEmpty()) << "it signs nothing";
}

/// With a member list.
class MemberLoops : public NodeLoops {
 protected:
  MemberLoops() {
    studio_.network.members = folder_ / "members.toml";
    studio_.network.authority = authority_.public_key().text();
    studio_.network.operator_key = folder_ / "ada.key";
    studio_.storage.signing_key = folder_ / "node.key";
    pc_.save(folder_ / "node.key");
    ada_.save(folder_ / "ada.key");
    bob_.save(folder_ / "bob.key");
    write_members(1, {member("ada", ada_), member("bob", bob_)});
  }
  static wire::Member member(const std::string& name, const wire::SigningKey& key,
                             wire::Role role = wire::Role::kOperator) {
    return {name, role, key.public_key()};
  }
  void write_members(int64_t serial, std::vector<wire::Member> people) const {
    people.push_back(member("cap01", pc_, wire::Role::kCapture));
    people.push_back(member("recon01", pc_, wire::Role::kReconstruction));
    people.push_back(member("guest", guest_, wire::Role::kViewer));
    replace_file(
        studio_.network.members,
        sign_member_list({.studio = "kyoto", .serial = serial, .members = people}, authority_));
  }
  /// The studio file and member list of Bob's PC, which does not receive his revocation.
  Studio studio_of_bob() const {
    Studio studio = studio_;
    studio.network.operator_key = folder_ / "bob.key";
    studio.network.members = folder_ / "members.bob.toml";
    std::filesystem::copy_file(studio_.network.members, studio.network.members);
    return studio;
  }
  bool health_has(control::OperatorClient& client, const std::string& text) const {
    return becomes_true(
        [&] {
          const auto health = client.health(within(5));
          return health.size() == 2 && std::ranges::all_of(health, [&](const auto& entry) {
                   return entry.second.text.find(text) != std::string::npos;
                 });
        },
        within(60));
  }

  const wire::SigningKey authority_ = wire::SigningKey::make(), ada_ = wire::SigningKey::make(),
                         bob_ = wire::SigningKey::make(), pc_ = wire::SigningKey::make(),
                         guest_ = wire::SigningKey::make();
};

TEST_F(MemberLoops, accept_an_operator_until_it_is_revoked_and_reject_an_older_list) {
  start();
  control::OperatorClient ada(studio_), bob(studio_of_bob());
  ASSERT_TRUE(accepts_command_of(bob));
  ASSERT_TRUE(accepts_command_of(ada));
  write_members(2, {member("ada", ada_)});
  EXPECT_TRUE(becomes_true([&] { return ignores_command_of(bob); }, within(60)));
  EXPECT_TRUE(accepts_command_of(ada));
  write_members(1, {member("ada", ada_), member("bob", bob_)});
  EXPECT_TRUE(health_has(ada, "expected more than 2, which is in force"));
  EXPECT_TRUE(becomes_true([&] { return ignores_command_of(bob); }, within(60)));
  write_members(3, {member("ada", ada_), member("bob", bob_)});
  EXPECT_TRUE(becomes_true([&] { return accepts_command_of(bob); }, within(60)))
      << "enrolled again";
}

TEST_F(MemberLoops, reject_a_viewer_that_signs_commands) {
  start();
  control::OperatorClient ada(studio_);
  ASSERT_TRUE(accepts_command_of(ada));
  bus::Bus bus(studio_.network.lcm_url, {}, bus::ChannelList(studio_));
  bus.authenticator().set_key(key_);
  wire::CommandMessage command;
  command.sender = "guest@viewer";
  command.verb = wire::CommandVerb::kAbort;
  command.to = {"cap01", "recon01"};
  const auto is_counted = [&] {
    command.sent = Realtime::now();
    bus.publish_command(sign_message(encode(command), guest_));
    return std::ranges::all_of(verified_health(ada), [](const auto& entry) {
      return entry.second.values.at("commands_unauthorized") >= 1;
    });
  };
  EXPECT_TRUE(becomes_true(is_counted, within(60)));
  EXPECT_TRUE(health_has(ada, "commands of guest are rejected: this member is not an operator"));
}

TEST_F(MemberLoops, report_a_rejected_list_beside_the_problem_of_their_delegate) {
  const std::string problem = "cannot keep up: 7 pulses dropped";
  capture_.emplace(studio_, "cap01", problem);
  recon_.emplace(studio_, "recon01", problem);
  control::OperatorClient ada(studio_);
  EXPECT_TRUE(health_has(ada, problem));
  write_members(1, {member("ada", ada_)});
  EXPECT_TRUE(health_has(ada, "expected more than 1, which is in force"));
  EXPECT_TRUE(health_has(ada, problem + "; "));
}

TEST_F(MemberLoops, reject_health_that_a_member_sends_in_the_name_of_a_node) {
  start();
  control::OperatorClient ada(studio_);
  ASSERT_TRUE(accepts_command_of(ada));
  bus::Bus bus(studio_.network.lcm_url, {}, bus::ChannelList(studio_));
  bus.authenticator().set_key(key_);
  bus.authenticator().members().require();
  bus.authenticator().members().set_signing_key(guest_);
  const auto registration = bus.subscribe(
      wire::kEventChannel, [](const bus::ReceivedMessage&) {});  // to respond to challenges
  wire::HealthMessage forged;
  forged.node = "cap01";
  forged.text = "forged";
  std::map<std::string, wire::HealthMessage> health;
  const auto is_counted = [&] {
    forged.sent = Realtime::now();
    bus.publish_authenticated(wire::health_channel("cap01"), encode(forged));
    health = ada.health(within(5));
    return health.contains("cap01") && health["cap01"].values["messages_unsigned"] >= 1;
  };
  EXPECT_TRUE(becomes_true(is_counted, within(60)));
  EXPECT_TRUE(control::is_verified(health["cap01"])) << health["cap01"].text;
  const auto is_reported = [&] {
    is_counted();
    return health["cap01"].text ==
           "V3D_HEALTH_cap01 of member guest is rejected: only cap01 may send it";
  };
  EXPECT_TRUE(becomes_true(is_reported, within(60))) << health["cap01"].text;
}

TEST_F(MemberLoops, are_reported_as_unverified_on_a_PC_without_the_member_list) {
  start();
  control::OperatorClient ada(studio_);
  ASSERT_TRUE(accepts_command_of(ada));
  Studio without_list = studio_;
  without_list.network.members = folder_ / "forgotten.toml";
  control::OperatorClient client(without_list);
  EXPECT_TRUE(health_has(client, "not verified: cannot read "));
  EXPECT_TRUE(health_has(client, "forgotten.toml: No such file or directory; v3dctl key enroll"));
}

TEST_F(MemberLoops, reject_every_command_until_there_is_a_member_list) {
  const Studio bobs = studio_of_bob();
  std::filesystem::remove(studio_.network.members);
  start();
  control::OperatorClient bob(bobs);
  EXPECT_TRUE(health_has(bob, "v3dctl key enroll makes it"));
  EXPECT_TRUE(becomes_true([&] { return ignores_command_of(bob); }, within(60)));
  write_members(1, {member("bob", bob_)});
  EXPECT_TRUE(becomes_true([&] { return accepts_command_of(bob); }, within(60)));
}

}  // namespace
}  // namespace v3d::node
