#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/core/error.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"
#include "take/take_listing.h"

namespace v3d::take {
namespace {

TEST(Slate, is_unchanged_after_saving_and_loading) {
  const test::TemporaryFolder folder;
  for (const Mark mark : {Mark::kNone, Mark::kCircled, Mark::kRejected}) {
    const Slate slate{.scene = "12a", .take = "3", .note = "she said \"cut\"\n", .mark = mark};
    EXPECT_TRUE(save_slate(folder / "slate.toml", slate));
    EXPECT_EQ(load_slate(folder / "slate.toml"), slate);
  }
}

TEST(Slate, is_empty_without_a_file) {
  EXPECT_EQ(load_slate("/nowhere/slate.toml"), Slate{});
  EXPECT_EQ(Slate{}.text(), "");
}

TEST(Slate, formats_its_fields_in_one_line) {
  EXPECT_EQ((Slate{.scene = "12", .take = "3", .note = "slips", .mark = Mark::kCircled}).text(),
            "scene 12, take 3, circled, slips");
  EXPECT_EQ((Slate{.scene = {}, .take = {}, .note = {}, .mark = Mark::kRejected}).text(),
            "rejected");
}

TEST(Slate, replaces_control_characters) {
  EXPECT_EQ((Slate{.scene = "1\x1b[2J", .take = {}, .note = "a\nb", .mark = Mark::kNone}).text(),
            "scene 1?[2J, a?b");
}

TEST(Slate, reports_the_invalid_field) {
  const auto error_message = [](const char* text) {
    return test::message_of<InputError>([&] { parse_slate(text, "slate.toml"); });
  };
  EXPECT_THAT(error_message("mark = \"good\"\n"),
              testing::HasSubstr("slate.toml:1: mark: expected"));
  EXPECT_THAT(error_message("scene = 12\n"), testing::HasSubstr("slate.toml:1: scene: expected"));
  EXPECT_THAT(error_message("actor = \"Li\"\n"), testing::HasSubstr("actor"));
}

}  // namespace
}  // namespace v3d::take
