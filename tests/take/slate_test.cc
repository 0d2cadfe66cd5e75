#include "take/slate.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/core/error.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"

namespace v3d {
namespace {

TEST(Slate, comes_back_from_its_file) {
  const test::TemporaryFolder folder;
  for (const Mark mark : {Mark::kNone, Mark::kCircled, Mark::kRejected}) {
    const Slate slate{.scene = "12a", .take = "3", .note = "she said \"cut\"\n", .mark = mark};
    EXPECT_TRUE(save_slate(folder / "slate.toml", slate));
    EXPECT_EQ(load_slate(folder / "slate.toml"), slate);
  }
}

TEST(Slate, of_a_take_on_which_nobody_wrote_is_empty) {
  EXPECT_EQ(load_slate("/nowhere/slate.toml"), Slate{});
  EXPECT_EQ(Slate{}.text(), "");
}

TEST(Slate, is_one_line_of_what_it_has) {
  EXPECT_EQ((Slate{.scene = "12", .take = "3", .note = "slips", .mark = Mark::kCircled}).text(),
            "scene 12, take 3, circled, slips");
  EXPECT_EQ((Slate{.scene = {}, .take = {}, .note = {}, .mark = Mark::kRejected}).text(),
            "rejected");
}

TEST(Slate, of_a_foreign_take_is_one_line_without_control_characters) {
  EXPECT_EQ((Slate{.scene = "1\x1b[2J", .take = {}, .note = "a\nb", .mark = Mark::kNone}).text(),
            "scene 1?[2J, a?b");
}

TEST(Slate, names_the_field_that_is_wrong) {
  const auto refusal = [](const char* text) {
    return test::message_of<InputError>([&] { parse_slate(text, "slate.toml"); });
  };
  EXPECT_THAT(refusal("mark = \"good\"\n"), testing::HasSubstr("slate.toml:1: mark: expected"));
  EXPECT_THAT(refusal("scene = 12\n"), testing::HasSubstr("slate.toml:1: scene: expected"));
  EXPECT_THAT(refusal("actor = \"Li\"\n"), testing::HasSubstr("actor"));
}

}  // namespace
}  // namespace v3d
