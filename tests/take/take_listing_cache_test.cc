#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <vector>

#include "base/io/file.h"
#include "support/begun_take.h"
#include "support/bytes_read.h"
#include "support/temporary_folder.h"
#include "take/logs/mesh_file.h"
#include "take/take_listing.h"

namespace v3d::take {
namespace {

namespace fs = std::filesystem;
using testing::IsEmpty;
using testing::SizeIs;

constexpr int64_t kPulses = 2000;

/// A folder with one take, whose mesh.v3d has an index of some 50 kB.
class ListedTake : public testing::Test {
 protected:
  ListedTake() {
    fs::create_directories(paths_.folder);
    TakeInfo info = test::begun_take({"cam01"});
    info.state = TakeState::kComplete;
    io::throw_if_failed(save_take_info(paths_, info));
    MeshFileWriter meshes(paths_.mesh());
    for (int64_t pulse = 0; pulse < kPulses; ++pulse) {
      io::throw_if_failed(meshes.append(pulse, std::vector<uint8_t>(20)));
    }
    io::throw_if_failed(meshes.close());
  }

  std::vector<TakeListing> list() { return cache_.find_all_takes(takes_.path()); }
  int64_t bytes_read_by_list() {
    const int64_t before = test::bytes_read();
    EXPECT_THAT(list(), SizeIs(1));
    return test::bytes_read() - before;
  }

  const test::TemporaryFolder takes_;
  const TakePaths paths_{takes_ / "kendo-07"};
  Duration passed_ = 2 * TakeListingCache::kSettled;  ///< since the files were written
  TakeListingCache cache_{[this] { return Realtime::now() + passed_; }};
};

TEST_F(ListedTake, is_not_read_again_without_a_change) {
  EXPECT_EQ(list().at(0).meshes, kPulses);
  EXPECT_LT(bytes_read_by_list(), 10'000) << "less than the index of the meshes";
  EXPECT_EQ(list().at(0).meshes, kPulses);
  EXPECT_EQ(list().at(0).info.name, "kendo-07");
}

TEST_F(ListedTake, is_read_again_after_a_change_of_any_of_its_files) {
  EXPECT_EQ(list().at(0).slate.note, "");
  EXPECT_TRUE(save_slate(paths_.slate(), {.scene = {}, .take = {}, .note = "slips"}));
  EXPECT_EQ(list().at(0).slate.note, "slips");
  fs::remove(paths_.slate());
  EXPECT_EQ(list().at(0).slate.note, "");
  fs::create_directory(paths_.sound());
  test::write_text(paths_.sound() / "cap01.wav", "RIFF");
  const int64_t bytes = list().at(0).bytes;
  test::write_text(paths_.sound() / "cap01.wav", "RIFFRIFF");
  EXPECT_EQ(list().at(0).bytes, bytes + 4);
  fs::remove_all(paths_.folder);
  EXPECT_THAT(list(), IsEmpty());
}

/// Two changes within a tick of the file system's clock may leave one time.
TEST_F(ListedTake, is_read_again_while_its_last_change_is_recent) {
  passed_ = {};
  EXPECT_EQ(list().at(0).meshes, kPulses);
  EXPECT_GT(bytes_read_by_list(), 10'000);
}

/// The cause of an error, such as too many open files, may end without a change of the take.
TEST_F(ListedTake, is_read_again_after_an_error) {
  test::write_text(paths_.slate(), "mark = 'circle'\n");
  EXPECT_NE(list().at(0).error, "");
  EXPECT_GT(bytes_read_by_list(), 10'000);
}

}  // namespace
}  // namespace v3d::take
