#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/io/file.h"
#include "support/temporary_folder.h"
#include "take/logs/log_files.h"

namespace v3d::take {
namespace {

using testing::HasSubstr;

const SegmentIndex kIndex{.bytes = 4000, .whole_bytes = 3500, .events = 7, .damaged_places = 1};
constexpr const char* kText = "bytes = 4000\nwhole_bytes = 3500\nevents = 7\ndamaged_places = 1\n";

class SegmentIndexFile : public testing::Test {
 protected:
  io::Result<std::optional<SegmentIndex>> load() const {
    return load_segment_index(segment_, kIndex.bytes);
  }
  std::string error() const {
    const auto loaded = load();
    return loaded ? "no error" : loaded.error().message;
  }

  const test::TemporaryFolder folder_;
  const std::filesystem::path segment_ = folder_ / "cam01.lcmlog";
  const std::filesystem::path file_ = folder_ / "cam01.lcmlog.index";
};

TEST_F(SegmentIndexFile, is_read_as_it_was_written) {
  EXPECT_EQ(load().value(), std::nullopt);
  ASSERT_TRUE(save_segment_index(segment_, kIndex));
  EXPECT_EQ(load().value(), kIndex);
  EXPECT_THAT(read_file(file_), testing::MatchesRegex("xxh3 = '[0-9a-f]+'\n" + std::string(kText)));
}

TEST_F(SegmentIndexFile, is_read_without_a_checksum_as_earlier_versions_wrote_it) {
  test::write_text(file_, kText);
  EXPECT_EQ(load().value(), kIndex);
}

TEST_F(SegmentIndexFile, is_never_another_one_after_a_change_of_any_bit) {
  ASSERT_TRUE(save_segment_index(segment_, kIndex));
  const std::string text = read_file(file_);
  for (size_t bit = 0; bit < 8 * text.size(); ++bit) {
    std::string changed = text;
    changed[bit / 8] = static_cast<char>(changed[bit / 8] ^ (1 << bit % 8));
    test::write_text(file_, changed);
    EXPECT_THAT(error(), HasSubstr(file_.string())) << "bit " << bit;
  }
}

TEST_F(SegmentIndexFile, is_rejected_with_the_cause) {
  test::write_text(file_, "xxh3 = '0123456789abcdef'\n" + std::string(kText));
  EXPECT_THAT(error(), HasSubstr("cam01.lcmlog.index: damaged: the checksum in its first line"));
  test::write_text(file_, "bytes = 4001\nwhole_bytes = 0\nevents = 0\ndamaged_places = 0\n");
  EXPECT_EQ(error(), "cannot use " + file_.string() +
                         ": it is the index of a segment of 4001 bytes, this one has 4000");
  std::filesystem::remove(file_);
  std::filesystem::create_directory(file_);
  EXPECT_EQ(error(), "cannot read " + file_.string() + ": it is not a regular file");
}

}  // namespace
}  // namespace v3d::take
