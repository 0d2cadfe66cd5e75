#include "take/take_files.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/mman.h>
#include <sys/statfs.h>

#include "base/core/bytes.h"
#include "base/io/file.h"
#include "base/io/unique_fd.h"
#include "support/temporary_folder.h"
#include "support/unreadable_byte.h"

namespace v3d::take {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;

uint64_t checksum_of(const std::string& text) {
  return checksum({std::span(reinterpret_cast<const uint8_t*>(text.data()), text.size())});
}

/// Number of pages of the file in the page cache.
size_t cached_pages(const fs::path& path) {
  const size_t size = fs::file_size(path);
  const io::UniqueFd fd(open(path.c_str(), O_RDONLY | O_CLOEXEC));
  void* const bytes = mmap(nullptr, size, PROT_READ, MAP_SHARED, fd.get(), 0);
  EXPECT_NE(bytes, MAP_FAILED);
  std::vector<unsigned char> pages((size + 4095) / 4096);
  EXPECT_EQ(mincore(bytes, size, pages.data()), 0);
  munmap(bytes, size);
  return static_cast<size_t>(std::ranges::count_if(pages, [](auto page) { return page & 1; }));
}

/// True for tmpfs, which has no disk.
bool is_memory(const fs::path& folder) {
  constexpr long kTmpfs = 0x01021994;
  struct statfs status {};
  return statfs(folder.c_str(), &status) == 0 && status.f_type == kTmpfs;
}

class TakeFiles : public testing::Test {
 protected:
  TakeFiles() {
    fs::create_directories(paths_.background());
    test::write_text(paths_.calib(), "# the rig\n");
    test::write_text(paths_.background() / "cam01.toml", "plates");
  }

  const test::TemporaryFolder folder_;
  const TakePaths paths_{folder_.path()};
};

TEST_F(TakeFiles, are_listed_with_plates_and_without_working_files) {
  for (const char* file : {".cap01.lock", "take.toml.part-12-1", "cam01.part-1.lcmlog"}) {
    test::write_text(paths_.folder / file, "x");
  }
  EXPECT_THAT(take_file_names(paths_).value(),
              ElementsAre("background/cam01.toml", "calib.toml", "cam01.part-1.lcmlog"));
}

TEST_F(TakeFiles, whose_names_are_not_utf8_are_foreign_as_are_other_folders) {
  test::write_text(paths_.folder / "M\xc3\xbcller.txt", "x");
  test::write_text(paths_.folder / "M\xfcller.txt", "x");
  test::write_text(paths_.background() / "\xff", "x");
  fs::create_directories(paths_.sound() / "mix");
  EXPECT_THAT(take_file_names(paths_).value(),
              ElementsAre("M\xc3\xbcller.txt", "background/cam01.toml", "calib.toml"));
  EXPECT_THAT(foreign_entries(paths_).value(),
              ElementsAre("M\xfcller.txt", "background/\xff", "sound/mix/"));
}

TEST_F(TakeFiles, have_the_checksum_of_their_bytes_from_cache_and_from_disk) {
  for (const ReadFrom from : {ReadFrom::kPageCache, ReadFrom::kDisk}) {
    const auto read = read_take_file(paths_, "calib.toml", from);
    ASSERT_TRUE(read) << read.error().message;
    EXPECT_EQ(read->bytes, 10);
    EXPECT_EQ(read->checksum, checksum_of("# the rig\n"));
    EXPECT_EQ(read->changed_ns, stat_take_file(paths_, "calib.toml")->changed_ns);
  }
  EXPECT_FALSE(read_take_file(paths_, "gone", ReadFrom::kDisk));
}

/// Dirty pages cannot be dropped from the page cache. After a read from the disk that fails at its
/// first byte, only the kernel's read-ahead may be cached.
TEST_F(TakeFiles, are_dropped_from_the_page_cache_before_a_read_from_disk) {
  if (is_memory(folder_.path())) GTEST_SKIP() << "no disk behind " << folder_.path();
  test::write_text(paths_.mesh(), std::string(16 << 20, 'm'));
  ASSERT_EQ(cached_pages(paths_.mesh()), 4096U);
  const test::UnreadableByte bad(0, folder_.path());
  ASSERT_FALSE(read_take_file(paths_, "mesh.v3d", ReadFrom::kDisk));
  EXPECT_LT(cached_pages(paths_.mesh()), 1024U);
}

TEST(TakeFilesAfterTheLedger, are_results_that_no_ledger_lists) {
  EXPECT_TRUE(is_written_after_ledger("mesh.v3d"));
  EXPECT_TRUE(is_written_after_ledger("proxy.v3d"));
  EXPECT_TRUE(is_written_after_ledger("motion.v3d"));
  EXPECT_TRUE(is_written_after_ledger("motion.earlier-2.v3d"));
  EXPECT_FALSE(is_written_after_ledger("cam01.lcmlog"));
}

TEST(ChecksumText, has_16_hexadecimal_digits_and_is_parsed_again) {
  EXPECT_EQ(checksum_text(0x2D06800538D394C2), "2d06800538d394c2");
  EXPECT_EQ(checksum_text(1), "0000000000000001");
  EXPECT_EQ(parse_checksum("2d06800538d394c2"), 0x2D06800538D394C2);
  for (const char* text : {"", "1", "2d06800538d394c", "2d06800538d394cg", "+d06800538d394c2"}) {
    EXPECT_FALSE(parse_checksum(text)) << text;
  }
}

}  // namespace
}  // namespace v3d::take
