#include "base/io/file.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/syscall.h>

#include <cerrno>
#include <csignal>
#include <thread>

#include "support/temporary_folder.h"

namespace {

/// While this is set, the file system has no RENAME_NOREPLACE, and cannot tell whether a file
/// exists whose name ends with "taken".
bool has_faults = false;

bool is_taken(const char* path) { return std::string_view(path).ends_with("taken"); }

}  // namespace

// These replace the functions of the C library in this program.
extern "C" int renameat2(int from_at, const char* from, int to_at, const char* to,
                         unsigned flags) noexcept {
  if (!has_faults || flags == 0) {
    return static_cast<int>(syscall(SYS_renameat2, from_at, from, to_at, to, flags));
  }
  errno = EINVAL;
  return -1;
}

extern "C" int lstat(const char* path, struct stat* status) noexcept {
  if (!has_faults || !is_taken(path)) return fstatat(AT_FDCWD, path, status, AT_SYMLINK_NOFOLLOW);
  errno = EIO;
  return -1;
}

namespace v3d::io {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::HasSubstr;

std::vector<uint8_t> bytes_of(std::string_view text) { return {text.begin(), text.end()}; }

TEST(UniqueFd, closes_its_descriptor_once_and_transfers_it_on_move) {
  int number = -1;
  {
    UniqueFd first(::open("/dev/null", O_RDONLY | O_CLOEXEC));
    number = first.get();
    const UniqueFd second(std::move(first));
    EXPECT_FALSE(first);  // NOLINT(bugprone-use-after-move): tests the moved-from state
    EXPECT_EQ(second.get(), number);
    EXPECT_GE(fcntl(number, F_GETFD), 0);
  }
  EXPECT_LT(fcntl(number, F_GETFD), 0);
}

TEST(IoFile, distinguishes_data_end_of_file_and_errors) {
  const test::TemporaryFolder folder;
  test::write_text(folder / "a", "0123456789");
  const auto file = File::open(folder / "a", OpenMode::kRead);
  ASSERT_TRUE(file);
  std::vector<uint8_t> bytes(4);
  EXPECT_EQ(file->read(0, bytes).value(), 4U);
  EXPECT_EQ(bytes, bytes_of("0123"));
  EXPECT_EQ(file->read(8, bytes).value(), 2U);
  EXPECT_EQ(file->read(10, bytes).value(), 0U);
  EXPECT_EQ(file->size().value(), 10U);
  close(file->fd());
  const auto failed = file->read(0, bytes);
  ASSERT_FALSE(failed);
  EXPECT_EQ(failed.error().code, EBADF);
  EXPECT_EQ(failed.error().message,
            "cannot read " + (folder / "a").string() + ": Bad file descriptor");
}

TEST(IoFile, writes_all_parts_in_sequence_at_the_offset) {
  const test::TemporaryFolder folder;
  {
    auto file = File::open(folder / "a", OpenMode::kCreate);
    ASSERT_TRUE(file);
    EXPECT_TRUE(file->write(0, {bytes_of("ab"), bytes_of(""), bytes_of("cdef")}));
    EXPECT_TRUE(file->write(1, {bytes_of("XY")}));
    EXPECT_TRUE(file->sync());
  }
  EXPECT_EQ(read_file(folder / "a").value(), "aXYdef");
}

TEST(IoFile, reports_a_write_beyond_the_file_size_limit) {
  const test::TemporaryFolder folder;
  auto file = File::open(folder / "a", OpenMode::kCreate);
  ASSERT_TRUE(file);
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  rlimit before{};
  getrlimit(RLIMIT_FSIZE, &before);
  const rlimit limit{5, before.rlim_max};
  setrlimit(RLIMIT_FSIZE, &limit);
  const Status written = file->write(0, {bytes_of("0123456789")});
  setrlimit(RLIMIT_FSIZE, &before);
  std::signal(SIGXFSZ, handler);
  ASSERT_FALSE(written);
  EXPECT_EQ(written.error().code, EFBIG);
  EXPECT_THAT(written.error().message, HasSubstr("cannot write " + (folder / "a").string()));
}

TEST(IoFile, create_rejects_an_existing_file) {
  const test::TemporaryFolder folder;
  test::write_text(folder / "a", "footage");
  const auto file = File::open(folder / "a", OpenMode::kCreate);
  ASSERT_FALSE(file);
  EXPECT_EQ(file.error().code, EEXIST);
  EXPECT_EQ(read_file(folder / "a").value(), "footage");
}

TEST(IoFile, rejects_a_fifo_and_a_folder_without_blocking) {
  const test::TemporaryFolder folder;
  ASSERT_EQ(mkfifo((folder / "fifo").c_str(), 0644), 0);
  for (const fs::path& path : {folder / "fifo", folder.path()}) {
    const auto content = read_file(path);
    ASSERT_FALSE(content);
    EXPECT_EQ(content.error().message,
              "cannot read " + path.string() + ": it is not a regular file");
  }
}

TEST(ReadFile, rejects_a_file_that_is_too_long) {
  const test::TemporaryFolder folder;
  test::write_text(folder / "a", std::string(100'000, 'x'));
  EXPECT_EQ(read_file(folder / "a", 100'000)->size(), 100'000U);
  EXPECT_THAT(read_file(folder / "a", 99'999).error().message,
              HasSubstr("it is longer than 99999 bytes"));
}

TEST(ReplaceFile, by_several_threads_leaves_one_complete_content_and_no_temporary_file) {
  const test::TemporaryFolder folder;
  std::vector<std::thread> threads;
  for (int t = 0; t < 4; ++t) {
    threads.emplace_back([&, t] {
      for (int i = 0; i < 20; ++i) {
        EXPECT_TRUE(replace_file(folder / "a", std::string(50'000, static_cast<char>('a' + t))));
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  const std::string content = read_file(folder / "a").value();
  EXPECT_EQ(content, std::string(50'000, content.front()));
  EXPECT_EQ(std::distance(fs::directory_iterator(folder.path()), {}), 1);
}

TEST(ReplaceFile, keeps_the_old_content_and_no_temporary_file_when_it_fails) {
  const test::TemporaryFolder folder;
  fs::create_directories(folder / "a/b");  // a folder cannot be replaced by a file
  const Status status = replace_file(folder / "a", "new");
  ASSERT_FALSE(status);
  EXPECT_THAT(status.error().message, HasSubstr("cannot replace " + (folder / "a").string()));
  EXPECT_TRUE(fs::is_directory(folder / "a/b"));
  EXPECT_EQ(std::distance(fs::directory_iterator(folder.path()), {}), 1);
}

TEST(SyncFolder, reports_a_missing_folder) {
  EXPECT_EQ(sync_folder("/nonexistent").error().message,
            "cannot sync folder /nonexistent: No such file or directory");
}

TEST(ListFolder, returns_sorted_entries_and_reports_a_missing_folder) {
  const test::TemporaryFolder folder;
  test::write_text(folder / "b", "");
  test::write_text(folder / "a", "");
  EXPECT_THAT(list_folder(folder.path()).value(), ElementsAre(folder / "a", folder / "b"));
  EXPECT_EQ(list_folder(folder / "none").error().code, ENOENT);
}

class RenameNewWithoutFlag : public testing::Test {
 protected:
  RenameNewWithoutFlag() { has_faults = true; }
  ~RenameNewWithoutFlag() override { has_faults = false; }

  const test::TemporaryFolder folder_;
};

TEST_F(RenameNewWithoutFlag, gives_files_and_folders_a_new_name) {
  test::write_text(folder_ / "file", "one");
  EXPECT_TRUE(rename_new(folder_ / "file", folder_ / "second"));
  EXPECT_EQ(read_file(folder_ / "second").value(), "one");
  fs::create_directories(folder_ / "take/background");
  EXPECT_TRUE(rename_new(folder_ / "take", folder_ / "copy"));
  EXPECT_TRUE(fs::exists(folder_ / "copy/background"));
  EXPECT_THAT(list_folder(folder_.path()).value(),
              ElementsAre(folder_ / "copy", folder_ / "second"));
}

TEST_F(RenameNewWithoutFlag, replaces_no_file_when_it_cannot_be_examined) {
  test::write_text(folder_ / "file", "one");
  test::write_text(folder_ / "taken", "footage");
  EXPECT_EQ(rename_new(folder_ / "file", folder_ / "taken").error().code, EEXIST);
  EXPECT_EQ(read_file(folder_ / "taken").value(), "footage");
  EXPECT_EQ(read_file(folder_ / "file").value(), "one");
}

TEST_F(RenameNewWithoutFlag, replaces_no_folder_not_even_an_empty_one) {
  fs::create_directories(folder_ / "take/background");
  fs::create_directories(folder_ / "taken");
  EXPECT_EQ(rename_new(folder_ / "take", folder_ / "taken").error().code, EEXIST);
  EXPECT_TRUE(fs::exists(folder_ / "take/background"));
}

TEST_F(RenameNewWithoutFlag, leaves_no_empty_folder_behind_after_a_failure) {
  fs::create_directories(folder_ / "take");
  EXPECT_FALSE(rename_new(folder_ / "take", folder_ / "take/inside"));
  EXPECT_TRUE(fs::is_empty(folder_ / "take"));
}

TEST(RenameNew, does_not_replace_an_existing_file) {
  const test::TemporaryFolder folder;
  test::write_text(folder / "a", "one");
  test::write_text(folder / "b", "two");
  EXPECT_EQ(rename_new(folder / "a", folder / "b").error().code, EEXIST);
  EXPECT_EQ(read_file(folder / "b").value(), "two");
  EXPECT_TRUE(rename_new(folder / "a", folder / "c"));
  EXPECT_EQ(read_file(folder / "c").value(), "one");
}

TEST(CopyFile, copies_every_byte_and_reports_a_missing_source) {
  const test::TemporaryFolder folder;
  const std::string content(3'000'000, 'x');
  test::write_text(folder / "a", content);
  EXPECT_TRUE(io::copy_file(folder / "a", folder / "b"));
  EXPECT_EQ(read_file(folder / "b").value(), content);
  EXPECT_THAT(io::copy_file(folder / "none", folder / "b").error().message,
              HasSubstr("cannot read " + (folder / "none").string()));
}

TEST(CreateFolders, creates_missing_parents_and_rejects_a_file_in_the_path) {
  const test::TemporaryFolder folder;
  EXPECT_TRUE(create_folders(folder / "a/b/c"));
  EXPECT_TRUE(create_folders(folder / "a/b/c"));
  EXPECT_TRUE(fs::is_directory(folder / "a/b/c"));
  test::write_text(folder / "file", "");
  const auto status = create_folders(folder / "file/b");
  ASSERT_FALSE(status);
  EXPECT_EQ(status.error().message,
            "cannot make folder " + (folder / "file").string() + ": a file has this name");
}

TEST(EntryType, is_that_of_the_name_itself_and_an_error_when_it_cannot_be_read) {
  const test::TemporaryFolder folder;
  test::write_text(folder / "file", "x");
  std::filesystem::create_symlink("file", folder / "link");
  std::filesystem::create_symlink("loop", folder / "loop");
  EXPECT_EQ(entry_type_of(folder / "file"), std::filesystem::file_type::regular);
  EXPECT_EQ(entry_type_of(folder / "link"), std::filesystem::file_type::symlink);
  EXPECT_EQ(type_of(folder / "link"), std::filesystem::file_type::regular);
  EXPECT_EQ(entry_type_of(folder / "file/below"), std::filesystem::file_type::not_found);
  EXPECT_EQ(entry_type_of(folder / "none"), std::filesystem::file_type::not_found);
  const auto failed = entry_type_of(folder / "loop/file");
  ASSERT_FALSE(failed);
  EXPECT_EQ(failed.error().message, "cannot read " + (folder / "loop/file").string() +
                                        ": Too many levels of symbolic links");
}

TEST(WholeRead, fails_at_the_end_of_the_file) {
  const test::TemporaryFolder folder;
  test::write_text(folder / "file", "0123456789");
  const auto file = File::open(folder / "file", OpenMode::kRead);
  ASSERT_TRUE(file);
  std::array<uint8_t, 4> bytes{};
  ASSERT_TRUE(file->read_whole(6, bytes));
  EXPECT_EQ(bytes[3], '9');
  const auto failed = file->read_whole(7, bytes);
  ASSERT_FALSE(failed);
  EXPECT_EQ(failed.error().code, EIO);
  EXPECT_EQ(failed.error().message, "cannot read " + (folder / "file").string() +
                                        ": the file became shorter while it was read");
}

}  // namespace
}  // namespace v3d::io
