#include "common/partial_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/core/error.h"
#include "base/io/file.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"

namespace v3d {
namespace {

using testing::HasSubstr;
namespace fs = std::filesystem;

class PartialFileTest : public testing::Test {
 protected:
  std::string rejection(const fs::path& file) {
    return test::message_of<InputError>([&] { PartialFile partial(file); });
  }
  ptrdiff_t entries() {
    return std::distance(fs::directory_iterator(folder_.path()), fs::directory_iterator());
  }
  const test::TemporaryFolder folder_;
};

TEST_F(PartialFileTest, gets_its_name_when_it_is_finished_also_in_place_of_an_earlier_file) {
  for (const std::string content : {"first", "second"}) {
    PartialFile partial(folder_ / "duel.mp4");
    EXPECT_EQ(partial.path().extension(), ".mp4");
    test::write_text(partial.path(), content);
    EXPECT_EQ(fs::exists(folder_ / "duel.mp4"), content == "second");
    partial.finish();
    EXPECT_EQ(read_file(folder_ / "duel.mp4"), content);
  }
  EXPECT_EQ(entries(), 1);
}

TEST_F(PartialFileTest, is_removed_unless_it_is_finished) {
  {
    const PartialFile partial(folder_ / "duel.mp4");
    test::write_text(partial.path(), "half");
  }
  EXPECT_EQ(entries(), 0);
}

TEST_F(PartialFileTest, replaces_no_folder_and_no_recorded_file) {
  fs::create_directories(folder_ / "take/sound");
  test::write_text(folder_ / "take/take.toml", "");
  test::write_text(folder_ / "take/sound/cap01.wav", "recorded");
  EXPECT_THAT(rejection(folder_ / "take"), HasSubstr("is a folder; expected the name of a file"));
  EXPECT_THAT(rejection(folder_ / "take/sound/cap01.wav"), HasSubstr("is a recorded file"));
}

}  // namespace
}  // namespace v3d
