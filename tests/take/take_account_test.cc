#include "take/ledger/take_account.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "support/begun_take.h"
#include "support/temporary_folder.h"

namespace v3d::take {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

TEST(TakeAccount, reports_a_file_whose_length_cannot_be_read_and_gives_it_no_entry) {
  const test::TemporaryFolder folder;
  const TakePaths paths{folder.path()};
  test::write_text(paths.calib(), "# the rig\n");
  std::filesystem::create_symlink("nowhere", folder / "notes.txt");
  const Ledger ledger{.take = "kendo-07", .sensed = {}, .cameras = {}};
  const auto unread = save_account(paths, test::begun_take({}), ledger);
  ASSERT_TRUE(unread);
  EXPECT_THAT(*unread, ElementsAre(HasSubstr("notes.txt: it is a symbolic link")));
  const Ledger saved = load_ledger(paths.ledger());
  EXPECT_EQ(saved.file("notes.txt"), nullptr) << "an entry would have a wrong length";
  EXPECT_NE(saved.file("calib.toml"), nullptr);
}

TEST(TakeAccount, reports_progress_for_each_mebibyte_of_sound) {
  const test::TemporaryFolder folder;
  const TakePaths paths{folder.path()};
  std::filesystem::create_directory(paths.sound());
  test::write_text(paths.sound() / "cap01.wav", std::string(4 << 20, 's'));
  const Ledger ledger{.take = "kendo-07", .sensed = {}, .cameras = {}};
  int calls = 0;
  ASSERT_TRUE(save_account(paths, test::begun_take({}), ledger, [&] { ++calls; }));
  EXPECT_EQ(calls, 4);
  EXPECT_TRUE(load_ledger(paths.ledger()).file("sound/cap01.wav")->checksum);
}

}  // namespace
}  // namespace v3d::take
