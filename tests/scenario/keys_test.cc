// Scenario tests of keys and member lists that are replaced while the studio records.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <map>

#include "daemon/bus/bus.h"
#include "studio4.h"
#include "take/ledger/verify.h"
#include "take/logs/mesh_file.h"
#include "wire/messages.h"

namespace v3d {
namespace {

using test::becomes_true;
using test::Studio4;
using test::within;

/// At 5 Hz, a busy machine records whole takes.
class StudioWithKey : public Studio4 {
 protected:
  StudioWithKey() : Studio4({.rate = "5"}) {}
};

TEST_F(StudioWithKey, replaces_its_key_while_it_records_and_loses_no_frame) {
  arm_and_start(0);
  ASSERT_TRUE(reaches("cap01", "frames_written", 40)) << log();
  const wire::StudioKey next = wire::StudioKey::make();
  next.save(folder_ / "next.key");
  std::filesystem::rename(folder_ / "next.key", studio_.network.key);

  // A receiver with only the new key accepts messages of all nodes, and the nodes accept each
  // other's.
  bus::Bus renewed(studio_.network.lcm_url, {}, bus::ChannelList(studio_));
  renewed.authenticator().set_key(next);
  bus::Subscription<wire::HealthMessage> captured(renewed, wire::health_channel("cap01"), 16);
  bus::Subscription<wire::HealthMessage> recond(renewed, wire::health_channel("recon01"), 16);
  ASSERT_TRUE(captured.wait(within(60))) << log();
  ASSERT_TRUE(recond.wait(within(60))) << log();
  ASSERT_TRUE(reaches("cap01", "frames_written", value("cap01", "frames_written") + 40)) << log();
  ASSERT_TRUE(reaches("recon01", "meshes", value("recon01", "meshes") + 5)) << log();
  EXPECT_EQ(value("recon01", "frames_lost"), 0);
  for (const char* node : {"cap01", "recon01"})
    EXPECT_EQ(value(node, "messages_forged"), 0) << node;

  control::OperatorClient newcomer(studio_);
  wire::CommandMessage stop;
  stop.verb = wire::CommandVerb::kStop;
  const control::Answer stopped = newcomer.command(stop, within(60));
  ASSERT_TRUE(stopped.done()) << text_of(stopped) << log();
  EXPECT_TRUE(verify_take(take()).whole()) << verify_take(take()).ledger.verdict();
  EXPECT_THAT(log(), testing::HasSubstr("a new studio key"));
}

class MemberStudio4 : public Studio4 {
 protected:
  MemberStudio4() : Studio4({.rate = "5", .has_members = true}) {}

  /// The studio with Bob's operator key and the old member list.
  Studio studio_of_bob() const {
    Studio studio = studio_;
    studio.network.operator_key = folder_ / "bob.key";
    studio.network.members = folder_ / "members.old.toml";
    return studio;
  }
};

TEST_F(MemberStudio4, records_a_take_and_rejects_an_operator_from_the_moment_of_its_revocation) {
  std::filesystem::copy_file(folder_ / "members.toml", folder_ / "members.old.toml");
  control::OperatorClient bob(studio_of_bob());
  wire::CommandMessage arm;
  arm.verb = wire::CommandVerb::kArm;
  arm.take = take_name_;
  const control::Answer armed = bob.command(arm, within(60));
  ASSERT_TRUE(armed.done()) << text_of(armed) << log();
  ASSERT_TRUE(command(wire::CommandVerb::kStart).done()) << log();
  ASSERT_TRUE(reaches("cap01", "frames_written", 40)) << log();

  wire::MemberList without_bob = members_;
  std::erase_if(without_bob.members,
                [](const wire::Member& member) { return member.name == "bob"; });
  ++without_bob.serial;
  write_members(without_bob);
  const auto is_in_force = [&] {
    return captured_->output().find("member list 2 is in force") != std::string::npos &&
           recond_->output().find("member list 2 is in force") != std::string::npos;
  };
  ASSERT_TRUE(becomes_true(is_in_force, within(60))) << log();
  wire::CommandMessage stop;
  stop.verb = wire::CommandVerb::kStop;
  EXPECT_THAT(bob.command(stop, within(2)).silent,
              testing::UnorderedElementsAre("cap01", "recon01"));
  for (const char* node : {"cap01", "recon01"}) {
    EXPECT_TRUE(reaches(node, "commands_forged", 1)) << log();
    EXPECT_EQ(client_->health(within(5)).at(node).state, wire::NodeState::kRecording);
  }
  std::map<std::string, double> forged;
  for (const char* node : {"cap01", "recon01"}) forged[node] = value(node, "commands_forged");
  // An older list does not restore Bob's rights, and no daemon was restarted.
  std::filesystem::copy_file(folder_ / "members.old.toml", folder_ / "members.toml",
                             std::filesystem::copy_options::overwrite_existing);
  const auto is_rejected = [&] {
    return captured_->output().find("expected more than 2, which is in force") != std::string::npos;
  };
  ASSERT_TRUE(becomes_true(is_rejected, within(60))) << log();
  EXPECT_EQ(bob.command(stop, within(2)).silent.size(), 2U);
  for (const char* node : {"cap01", "recon01"}) {
    EXPECT_TRUE(reaches(node, "commands_forged", forged[node] + 1)) << log();
    EXPECT_EQ(client_->health(within(5)).at(node).state, wire::NodeState::kRecording);
  }

  const control::Answer stopped = command(wire::CommandVerb::kStop);
  ASSERT_TRUE(stopped.done()) << text_of(stopped) << log();
  EXPECT_TRUE(verify_take(take()).whole()) << verify_take(take()).ledger.verdict();
}

/// v3d-recond restarts in the take and learns the frame key again. Its list of before the restart
/// is remembered.
TEST_F(MemberStudio4, reconstructs_again_after_a_restart_but_not_with_an_older_member_list) {
  const std::filesystem::path old_list = folder_ / "members.old.toml";
  std::filesystem::copy_file(folder_ / "members.toml", old_list);
  wire::MemberList next = members_;
  next.serial = 2;
  write_members(next);
  arm_and_start(0);
  ASSERT_TRUE(reaches("recon01", "meshes", 5)) << log();
  EXPECT_EQ(value("recon01", "messages_forged"), 0);
  recond_->signal(SIGKILL);
  ASSERT_TRUE(recond_->wait(within(60)));
  const size_t meshes = take::MeshFileReader(take().mesh()).pulses().size();

  std::filesystem::copy_file(old_list, folder_ / "members.toml",
                             std::filesystem::copy_options::overwrite_existing);
  start_recond();
  const auto is_rejected = [&] {
    return recond_->output().find("serial: expected at least 2, which this node accepted") !=
           std::string::npos;
  };
  ASSERT_TRUE(becomes_true(is_rejected, within(60))) << log();
  write_members(next);
  client_.emplace(studio_);
  EXPECT_TRUE(reaches("recon01", "meshes", static_cast<double>(meshes + 10))) << log();
  EXPECT_EQ(value("recon01", "messages_forged"), 0);
  const control::Answer stopped = command(wire::CommandVerb::kStop);
  ASSERT_TRUE(stopped.done()) << text_of(stopped) << log();
  EXPECT_TRUE(verify_take(take()).whole()) << verify_take(take()).ledger.verdict();
}

}  // namespace
}  // namespace v3d
