// Irregular files in a take folder: readers reject every file that is not a regular file of that
// folder, without blocking.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>

#include <filesystem>
#include <fstream>
#include <functional>
#include <map>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "base/config/calib_file.h"
#include "base/core/error.h"
#include "base/io/file.h"
#include "base/io/unique_fd.h"
#include "support/begun_take.h"
#include "support/temporary_folder.h"
#include "support/unreadable_byte.h"
#include "take/ledger/ledger.h"
#include "take/ledger/take_account.h"
#include "take/logs/event_log.h"
#include "take/logs/mesh_file.h"
#include "take/take.h"
#include "take/take_listing.h"

namespace v3d::take {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

constexpr const char* kCalib = R"([cam_0]
name = "cam01"
size = [64, 48]
matrix = [[50.0, 0.0, 32.0], [0.0, 50.0, 24.0], [0.0, 0.0, 1.0]]
distortions = []
rotation = [0.0, 0.0, 0.0]
translation = [0.0, 0.0, 0.0]
)";

constexpr const char* kStudio = R"(name = "kyoto"
[[node]]
name = "cap01"
[[node]]
name = "recon01"
[[camera]]
name = "cam01"
node = "cap01"
address = "V3D-SIM-01"
[trigger]
node = "cap01"
kind = "simulated"
rate_hz = 25
wire = "trigger.sock"
[space]
min = [-1.5, -1.5, 0]
max = [1.5, 1.5, 2]
[storage]
takes = "takes"
background = "/var/lib/v3d/background"
calib = "calib.toml"
[reconstruction]
node = "recon01"
voxel_m = 0.008
min_views = 1
)";

void make_fifo(const fs::path& path) { ASSERT_EQ(mkfifo(path.c_str(), 0644), 0); }

void make_socket(const fs::path& path) {
  const io::UniqueFd fd(socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0));
  sockaddr_un here{};
  here.sun_family = AF_UNIX;
  ASSERT_LT(path.string().size(), sizeof here.sun_path);
  path.string().copy(here.sun_path, sizeof here.sun_path - 1);
  ASSERT_EQ(bind(fd.get(), reinterpret_cast<const sockaddr*>(&here), sizeof here), 0);
}

class IrregularTakeFiles : public testing::Test {
 protected:
  IrregularTakeFiles() {
    fs::create_directory(take_.folder);
    EXPECT_TRUE(save_take_info(take_, test::begun_take({"cam01"})));
    std::ofstream(take_.slate()) << "note = \"good\"\n";
    std::ofstream(take_.calib()) << kCalib;
    std::ofstream(take_.studio()) << kStudio;
    MeshFileWriter meshes(take_.mesh());
    EXPECT_TRUE(meshes.append(0, std::vector<uint8_t>(20, 1)));
    EXPECT_TRUE(meshes.close());
    std::ofstream(take_.pulses());
  }

  /// Replaces a file by a link to a copy outside of the take.
  void link_out(const fs::path& path) {
    const fs::path outside = folder_ / ("outside-" + path.filename().string());
    fs::rename(path, outside);
    fs::create_symlink(outside, path);
  }

  const test::TemporaryFolder folder_;
  const TakePaths take_{folder_ / "kendo-07"};
  const std::map<fs::path, std::function<void()>> readers_ = {
      {take_.info(), [this] { load_take_info(take_); }},
      {take_.slate(), [this] { load_slate(take_.slate()); }},
      {take_.calib(), [this] { load_take_calib(take_); }},
      {take_.studio(), [this] { EXPECT_TRUE(load_take_studio(take_)); }},
      {take_.mesh(), [this] { MeshFileReader{take_.mesh()}; }},
      {take_.pulses(), [this] { EventLogReader{take_.pulses()}; }}};
};

TEST_F(IrregularTakeFiles, are_read_when_they_are_regular_files) {
  for (const auto& [path, read] : readers_) EXPECT_NO_THROW(read()) << path;
}

TEST_F(IrregularTakeFiles, are_rejected_when_they_are_fifos_sockets_devices_folders_or_links) {
  const std::map<std::string, std::function<void(const fs::path&)>> wrong = {
      {"a FIFO", make_fifo},
      {"a socket", make_socket},
      {"a folder", [](const fs::path& path) { fs::create_directory(path); }},
      {"a link to a device", [](const fs::path& path) { fs::create_symlink("/dev/zero", path); }}};
  for (const auto& [path, read] : readers_) {
    for (const auto& [what, make] : wrong) {
      fs::rename(path, folder_ / "kept");
      make(path);
      EXPECT_THROW(read(), InputError) << path << ": " << what;
      fs::remove(path);
      fs::rename(folder_ / "kept", path);
    }
    link_out(path);
    EXPECT_THROW(read(), InputError) << path << ": a link out of the take";
  }
}

TEST_F(IrregularTakeFiles, are_rejected_with_the_cause) {
  link_out(take_.slate());
  try {
    load_slate(take_.slate());
    FAIL();
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("slate.toml: it is a symbolic link"));
  }
}

TEST_F(IrregularTakeFiles, are_read_from_a_linked_take_folder) {
  const TakePaths linked{folder_ / "linked"};
  fs::create_directory_symlink(take_.folder, linked.folder);
  EXPECT_EQ(load_take_info(linked).name, "kendo-07");
  EXPECT_EQ(load_slate(linked.slate()).note, "good");
  EXPECT_EQ(MeshFileReader(linked.mesh()).pulses().size(), 1u);
}

TEST_F(IrregularTakeFiles, are_not_treated_as_absent_when_their_folder_cannot_be_examined) {
  const fs::path loop = folder_ / "loop";
  fs::create_symlink("loop", loop);
  const TakePaths behind{loop / "kendo-07"};
  const auto rejects_with_cause = testing::ThrowsMessage<InputError>(testing::AllOf(
      HasSubstr("cannot read " + loop.string()), HasSubstr("Too many levels of symbolic links")));
  EXPECT_THAT([&] { load_take_info(behind); }, rejects_with_cause);
  EXPECT_THAT([&] { load_take_studio(behind); }, rejects_with_cause);
  EXPECT_THAT([&] { find_takes(behind.folder, [](const InputError&) {}); }, rejects_with_cause);
  EXPECT_FALSE(take_file_names(behind));
  EXPECT_FALSE(stat_take_file(behind, "take.toml"));
}

TEST_F(IrregularTakeFiles, are_rejected_when_text_exceeds_the_size_limit) {
  for (const fs::path& path : {take_.info(), take_.slate(), take_.calib(), take_.studio()}) {
    std::ofstream(path, std::ios::app) << "\n#" << std::string(kMaxTakeTextBytes, 'x') << "\n";
    EXPECT_THROW(readers_.at(path)(), InputError) << path;
  }
}

TEST_F(IrregularTakeFiles, do_not_block_the_listing_of_other_takes_when_they_are_fifos) {
  const TakePaths other{folder_ / "kendo-08"};
  fs::copy(take_.folder, other.folder);
  for (const char* name :
       {"take.toml", "slate.toml", "verified.toml", "ledger.toml", "mesh.v3d", "calib.toml"}) {
    fs::remove(take_.folder / name);
    make_fifo(take_.folder / name);
    const auto takes = find_takes(folder_.path(), [](const InputError&) {});
    ASSERT_FALSE(takes.empty()) << name;
    EXPECT_EQ(takes.back().paths.folder, other.folder) << name;
  }
}

TEST_F(IrregularTakeFiles, are_reported_and_do_not_end_the_listing_when_they_are_loops_of_links) {
  const TakePaths other{folder_ / "kendo-08"};
  for (const char* name : {"take.toml", "slate.toml", "verified.toml", "ledger.toml", "mesh.v3d"}) {
    fs::remove_all(other.folder);
    fs::copy(take_.folder, other.folder);
    fs::remove(other.folder / name);
    fs::create_symlink(name, other.folder / name);
    std::vector<std::string> reports;
    const auto takes = find_takes(
        folder_.path(), [&](const InputError& error) { reports.emplace_back(error.what()); });
    const std::set<std::string> optional = {"mesh.v3d", "verified.toml"};  // can be made again
    ASSERT_EQ(takes.size(), optional.contains(name) ? 2u : 1u) << name;
    EXPECT_EQ(takes.front().paths.folder, take_.folder) << name;
    if (optional.contains(name)) continue;
    EXPECT_THAT(reports, testing::ElementsAre(HasSubstr(name))) << name;
  }
}

TEST_F(IrregularTakeFiles, are_listed_with_the_cause_instead_of_no_meshes) {
  const auto listed = [&] { return read_take_listing(take_); };
  EXPECT_EQ(listed().meshes, 1);
  {
    const test::UnreadableByte bad(0, take_.folder);
    EXPECT_EQ(listed().meshes, std::nullopt);
    EXPECT_EQ(listed().mesh_error, "cannot read " + take_.mesh().string() + ": Input/output error");
  }
  test::write_text(take_.mesh(), "");
  EXPECT_THAT(listed().mesh_error, HasSubstr("mesh.v3d: is not a mesh file"));
  fs::remove(take_.mesh());
  EXPECT_EQ(listed().meshes, 0) << "the take was not reconstructed";
}

TEST_F(IrregularTakeFiles, are_rejected_when_ledger_or_verification_are_links) {
  for (const fs::path& path : {take_.ledger(), take_.verified()}) {
    fs::create_symlink(take_.info(), path);
    EXPECT_THAT([&] { load_ledger(path); },
                testing::ThrowsMessage<InputError>(HasSubstr("it is a symbolic link")));
  }
  EXPECT_FALSE(load_verified(take_));
}

}  // namespace
}  // namespace v3d::take
