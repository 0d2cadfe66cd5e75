#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/core/error.h"
#include "base/io/file.h"
#include "common/partial_file.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"

namespace v3d {
namespace {

using testing::HasSubstr;
namespace fs = std::filesystem;

class PartialFolderTest : public testing::Test {
 protected:
  std::string rejection(const fs::path& folder) {
    return test::message_of<InputError>([&] { PartialFolder partial(folder); });
  }
  ptrdiff_t entries() {
    return std::distance(fs::directory_iterator(folder_.path()), fs::directory_iterator());
  }
  const test::TemporaryFolder folder_;
};

TEST_F(PartialFolderTest, appears_when_it_is_finished_also_in_place_of_an_empty_folder) {
  for (const char* name : {"new", "empty/"}) {
    if (name == std::string("empty/")) fs::create_directory(folder_ / name);
    PartialFolder partial(folder_ / name);
    test::write_text(partial.path() / "file", "content");
    EXPECT_FALSE(fs::exists(folder_ / name / "file"));
    partial.finish();
    EXPECT_EQ(read_file(folder_ / name / "file"), "content");
  }
  EXPECT_EQ(entries(), 2);
}

TEST_F(PartialFolderTest, is_removed_unless_it_is_finished) {
  {
    const PartialFolder partial(folder_ / "out");
    test::write_text(partial.path() / "file", "content");
  }
  EXPECT_EQ(entries(), 0);
}

TEST_F(PartialFolderTest, rejects_a_folder_with_files_a_file_and_a_missing_parent) {
  fs::create_directory(folder_ / "full");
  test::write_text(folder_ / "full/file", "content");
  EXPECT_THAT(rejection(folder_ / "full"), HasSubstr("is not empty; expected a new or an empty"));
  EXPECT_THAT(rejection(folder_ / "full/file"), HasSubstr("is a file; expected the name of a new"));
  EXPECT_THAT(rejection(folder_ / "absent/out"), HasSubstr("No such file or directory"));
}

TEST_F(PartialFolderTest, replaces_no_folder_that_has_got_files_meanwhile) {
  {
    PartialFolder partial(folder_ / "out");
    fs::create_directory(folder_ / "out");
    test::write_text(folder_ / "out/file", "of somebody else");
    EXPECT_THROW(partial.finish(), std::runtime_error);
  }
  EXPECT_EQ(read_file(folder_ / "out/file"), "of somebody else");
  EXPECT_EQ(entries(), 1);
}

TEST_F(PartialFolderTest, replaces_a_folder_with_files_when_it_may) {
  fs::create_directory(folder_ / "out");
  test::write_text(folder_ / "out/file", "earlier");
  {
    PartialFolder partial(folder_ / "out", PartialFolder::Existing::kReplace);
    test::write_text(partial.path() / "other", "new");
    EXPECT_EQ(read_file(folder_ / "out/file"), "earlier");
    partial.finish();
    EXPECT_EQ(read_file(folder_ / "out/other"), "new");
  }
  EXPECT_FALSE(fs::exists(folder_ / "out/file"));
  EXPECT_EQ(entries(), 1);
}

}  // namespace
}  // namespace v3d
