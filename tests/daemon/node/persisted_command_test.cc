#include "daemon/node/persisted_command.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "daemon/node/take_folder.h"
#include "support/temporary_folder.h"

namespace v3d::node {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::IsEmpty;
using testing::Key;

class PersistedCommandTest : public testing::Test {
 protected:
  PersistedCommandTest() {
    studio_.storage.takes = folder_ / "takes";
    for (const char* take : {"kendo-07", "kendo-08"}) {
      fs::create_directories(take_paths(studio_, take).folder);
      wire::CommandMessage command;
      command.verb = wire::CommandVerb::kArm;
      command.sender = "desk";
      command.take = take;
      persist_command(studio_, "cap01", command);
    }
  }
  /// Makes the command of a take unreadable: EISDIR.
  void damage(const std::string& take) {
    const fs::path command = take_paths(studio_, take).folder / ".order-cap01";
    fs::remove(command);
    fs::create_directory(command);
  }

  const test::TemporaryFolder folder_;
  Studio studio_;
};

TEST_F(PersistedCommandTest, is_found_for_its_own_node_only) {
  EXPECT_THAT(persisted_commands(studio_, "cap01").commands,
              ElementsAre(Key("kendo-07"), Key("kendo-08")));
  EXPECT_THAT(persisted_commands(studio_, "cap02").commands, IsEmpty());
  EXPECT_TRUE(has_persisted_command(take_paths(studio_, "kendo-07"), "cap01").value());
  EXPECT_FALSE(has_persisted_command(take_paths(studio_, "kendo-07"), "cap02").value());
}

TEST_F(PersistedCommandTest, that_cannot_be_read_is_reported_as_unread_and_not_as_absent) {
  damage("kendo-08");
  const CommandsOnDisk found = persisted_commands(studio_, "cap01");
  EXPECT_THAT(found.commands, ElementsAre(Key("kendo-07")));
  EXPECT_THAT(found.unread, ElementsAre("kendo-08"));
}

TEST_F(PersistedCommandTest, is_not_searched_in_a_file_beside_the_takes) {
  test::write_text(studio_.storage.takes / "notes.txt", "fight");
  const CommandsOnDisk found = persisted_commands(studio_, "cap01");
  EXPECT_THAT(found.commands, ElementsAre(Key("kendo-07"), Key("kendo-08")));
  EXPECT_THAT(found.unread, IsEmpty());
}

TEST_F(PersistedCommandTest, is_dropped_with_all_others_even_when_it_cannot_be_read) {
  const fs::path damaged = take_paths(studio_, "kendo-08").folder / ".order-cap01";
  test::write_text(damaged, "no command");
  PersistedCommands commands(studio_, "cap01");
  commands.drop_all();
  EXPECT_FALSE(fs::exists(damaged));
  EXPECT_FALSE(fs::exists(take_paths(studio_, "kendo-07").folder / ".order-cap01"));
}

TEST_F(PersistedCommandTest, may_exist_in_a_folder_of_takes_that_cannot_be_listed) {
  const fs::path file = take_paths(studio_, "kendo-07").folder / ".order-cap01";
  studio_.storage.takes = folder_ / "missing";
  EXPECT_TRUE(persisted_commands(studio_, "cap01").folder_was_listed);
  studio_.storage.takes = file;
  EXPECT_FALSE(persisted_commands(studio_, "cap01").folder_was_listed);
}

}  // namespace
}  // namespace v3d::node
