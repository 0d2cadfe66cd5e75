#include "v3dctl/edit/editor.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/core/error.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"
#include "tools/gliding_take.h"

namespace v3d::ctl {
namespace {

using testing::HasSubstr;
namespace fs = std::filesystem;

TakeClip read(const fs::path& take) {
  return read_clip(
      take, [](int64_t) {}, [] {});
}

/// An action, and a second take for splices.
class EditorTest : public testing::Test {
 protected:
  EditorTest() { test::write_gliding_take(folder_ / "take"); }

  std::string rejection(const Edit& edit) {
    return test::message_of<InputError>([&] { editor_.apply(edit); });
  }

  const test::TemporaryFolder folder_;
  const Edit splice_{"edit.json: operations[0]",
                     SpliceEdit{.take = folder_ / "other", .at = {}, .from = {}, .blend = 2}};
  TakeClip edited_;
  Editor editor_{edited_, read};
};

TEST_F(EditorTest, splices_only_takes_of_one_pulse_rate) {
  edited_ = read(folder_ / "take");
  test::write_gliding_take(folder_ / "other", 50);
  EXPECT_EQ(rejection(splice_), "edit.json: operations[0].take: " + (folder_ / "other").string() +
                                    " has 50 pulses a second, the action 25; expected the same");
  EXPECT_EQ(edited_.clip.frames.size(), size_t{test::kGlidingPulses});
  fs::remove_all(folder_ / "other");
  test::write_gliding_take(folder_ / "other", 25.0001);
  editor_.apply(splice_);
  EXPECT_EQ(editor_.splices().size(), 1U);
}

}  // namespace
}  // namespace v3d::ctl
