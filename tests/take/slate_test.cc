#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <thread>

#include "base/core/error.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"
#include "take/joined_slate.h"
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

/// Two people, or two scripts, write on one slate.
TEST(Slate, loses_no_change_of_those_made_at_the_same_time) {
  constexpr int kChanges = 25;
  const test::TemporaryFolder folder;
  const TakePaths take{folder.path()};
  const auto write = [&](std::string Slate::*field) {
    for (int i = 0; i < kChanges; ++i) change_slate(take, [&](Slate& s) { (s.*field) += "x"; });
  };
  std::thread ben(write, &Slate::note);
  write(&Slate::scene);
  ben.join();
  const Slate slate = load_slate(take.slate());
  EXPECT_EQ(slate.scene, std::string(kChanges, 'x'));
  EXPECT_EQ(slate.note, std::string(kChanges, 'x'));
}

TEST(MergedSlate, has_the_fields_of_all_and_names_the_nodes_where_they_differ) {
  const Slate merged = merged_slate(
      {{"cap01", {.scene = {}, .take = "3", .note = "slips", .mark = Mark::kRejected}},
       {"cap02", {.scene = "12", .take = "4", .note = "second attack", .mark = Mark::kCircled}},
       {"cap03", {.scene = "12", .take = {}, .note = "slips", .mark = Mark::kNone}}});
  EXPECT_EQ(merged, (Slate{.scene = "12",
                           .take = "3",
                           .note = "slips; cap01: rejected; cap02: take 4, second attack",
                           .mark = Mark::kCircled}));
}

/// A circled take is not deleted, whatever another PC says.
TEST(MergedSlate, loses_no_text_and_no_circle_of_any_node) {
  const std::vector<std::string> texts = {"", "12", "a slip"};
  std::vector<Slate> slates;
  for (const std::string& scene : texts) {
    for (const std::string& note : texts) {
      for (const Mark mark : {Mark::kNone, Mark::kCircled, Mark::kRejected}) {
        slates.push_back({.scene = scene, .take = note, .note = note, .mark = mark});
      }
    }
  }
  for (const Slate& a : slates) {
    EXPECT_EQ(merged_slate({{"cap01", a}, {"cap02", a}}), a) << "equal slates are not repeated";
    for (const Slate& b : slates) {
      const Slate merged = merged_slate({{"cap01", a}, {"cap02", b}});
      for (const Slate& slate : {a, b}) {
        for (const std::string& text : {slate.scene, slate.take, slate.note}) {
          EXPECT_THAT(merged.text(), testing::HasSubstr(text));
        }
        EXPECT_THAT(merged.text(), testing::HasSubstr(std::string(name(slate.mark))));
        EXPECT_TRUE(slate.mark != Mark::kCircled || merged.mark == Mark::kCircled);
        EXPECT_EQ(text_not_in(merged, slate), "") << merged.text();
      }
    }
  }
}

TEST(TextOfASlate, is_not_in_a_copy_that_has_only_a_part_of_it) {
  const Slate slate{
      .scene = "12", .take = "4", .note = "use the second attack", .mark = Mark::kRejected};
  EXPECT_EQ(text_not_in(slate, slate), "");
  EXPECT_EQ(text_not_in({}, slate), "scene 12, take 4, rejected, use the second attack");
  EXPECT_EQ(text_not_in(slate, {}), "") << "the copy may have more";
  Slate copy = slate;
  copy.note = "do not use the second attack; cap02: scene 120";
  EXPECT_EQ(text_not_in(copy, slate), "use the second attack");
  copy.scene = "";
  EXPECT_EQ(text_not_in(copy, slate), "scene 12, use the second attack");
  copy.note = "slips; cap02: scene 12, use the second attack; cap03: circled";
  EXPECT_EQ(text_not_in(copy, slate), "");
}

}  // namespace
}  // namespace v3d::take
