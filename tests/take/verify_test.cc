#include "take/ledger/verify.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <algorithm>
#include <map>

#include "base/core/error.h"
#include "base/io/file.h"
#include "support/begun_take.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"
#include "support/unreadable_byte.h"
#include "take/ledger/take_account.h"
#include "take/logs/frame_log.h"
#include "take/logs/mesh_file.h"

namespace v3d::take {
namespace {

using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

wire::FrameMessage frame_of(const std::string& camera, int64_t pulse) {
  wire::FrameMessage m;
  m.frame.camera = camera;
  m.frame.label.pulse = pulse;
  m.frame.sensor_size = {4, 2};
  m.frame.roi = {0, 0, 4, 2};
  m.frame.image = Image({4, 2}, PixelFormat::kMono8);
  return m;
}

/// A complete take of two cameras and three pulses.
class VerifyTake : public testing::Test {
 protected:
  VerifyTake() {
    info_ = test::begun_take({"cam01", "cam02"});
    info_.pulses = 3;
    info_.state = TakeState::kComplete;
    EXPECT_TRUE(save_take_info(paths_, info_));
    test::write_text(paths_.calib(), "");
    Ledger ledger{.take = "kendo-07", .commanded = 3, .sensed = 3, .cameras = {}};
    EventLogWriter pulses(paths_.pulses());
    for (int64_t pulse = 0; pulse < 3; ++pulse) {
      wire::PulseMessage m;
      m.pulse = pulse;
      EXPECT_TRUE(pulses.write(m));
    }
    for (const std::string& camera : info_.cameras) {
      EventLogWriter frames(paths_.frames(camera));
      for (int64_t pulse = 0; pulse < 3; ++pulse)
        EXPECT_TRUE(frames.write(frame_of(camera, pulse)));
      ledger.cameras.push_back(account(camera, {0, 1, 2}, {}, 3));
    }
    EXPECT_TRUE(save_ledger(paths_.ledger(), ledger));
  }

  const test::TemporaryFolder folder_;
  const TakePaths paths_{folder_.path()};
  TakeInfo info_;
};

TEST_F(VerifyTake, is_whole_when_files_and_ledger_agree) {
  const Verification v = verify_take(paths_);
  EXPECT_TRUE(v.whole());
  EXPECT_THAT(v.disagreements, IsEmpty());
  EXPECT_EQ(v.ledger.verdict(),
            "take kendo-07: complete, 2 cameras x 3 pulses, 0 missing, 0 suspect");
}

/// A recovery must not give a damaged file the right checksum.
TEST_F(VerifyTake, reports_a_changed_file_of_a_closed_take_after_a_recovery_too) {
  test::write_text(paths_.folder / "studio.toml", "name = 'dojo'");
  EXPECT_TRUE(save_account(paths_, info_, load_ledger(paths_.ledger())));
  const std::string ledger = read_file(paths_.ledger());
  test::write_text(paths_.folder / "studio.toml", "name = 'Dojo'");
  EXPECT_THAT(recover_take(paths_, AfterReadErrors::kRecover).notes,
              ElementsAre("ledger.toml: was kept, because the take was closed before"));
  EXPECT_EQ(read_file(paths_.ledger()), ledger);
  const Verification v = verify_take(paths_);
  EXPECT_EQ(v.info.state, TakeState::kComplete);
  EXPECT_THAT(v.disagreements, ElementsAre(HasSubstr("studio.toml: has the checksum")));
}

TEST_F(VerifyTake, reports_a_torn_frame_as_missing) {
  const std::string log = read_file(paths_.frames("cam02"));
  test::write_text(paths_.frames("cam02"), log.substr(0, log.size() - 1));
  const Verification v = verify_take(paths_);
  EXPECT_FALSE(v.whole());
  EXPECT_THAT(v.ledger.cameras[1].missing, ElementsAre(2));
  EXPECT_THAT(v.disagreements, ElementsAre(HasSubstr("cam02.lcmlog: ends in an unfinished event"),
                                           "cam02.lcmlog: holds 2 frames, the ledger says 3"));
}

TEST_F(VerifyTake, does_not_count_a_frame_with_a_damaged_body) {
  std::string log = read_file(paths_.frames("cam01"));
  const size_t camera_name = log.find("cam01", 60);
  log[camera_name] = 'C';
  test::write_text(paths_.frames("cam01"), log);
  const Verification v = verify_take(paths_);
  EXPECT_THAT(v.ledger.cameras[0].missing, ElementsAre(0));
  EXPECT_THAT(v.disagreements, testing::Contains("cam01.lcmlog: 1 damaged events"));
}

TEST_F(VerifyTake, does_not_count_a_frame_with_a_changed_pixel) {
  std::string log = read_file(paths_.frames("cam01"));
  log.back() = static_cast<char>(log.back() ^ 1);
  test::write_text(paths_.frames("cam01"), log);
  const Verification v = verify_take(paths_);
  EXPECT_THAT(v.ledger.cameras[0].missing, ElementsAre(2));
  EXPECT_THAT(v.disagreements, testing::Contains("cam01.lcmlog: 1 damaged events"));
}

TEST_F(VerifyTake, reports_every_pulse_of_a_missing_log_as_missing) {
  std::filesystem::remove(paths_.frames("cam01"));
  const Verification v = verify_take(paths_);
  EXPECT_THAT(v.ledger.cameras[0].missing, ElementsAre(0, 1, 2));
  EXPECT_THAT(v.disagreements[0], HasSubstr("cam01.lcmlog: No such file"));
}

/// A sparse file of 4 KiB can claim an event of any length.
TEST_F(VerifyTake, reads_no_body_of_an_event_without_a_frame_header) {
  constexpr uint32_t kClaimed = 200 << 20;
  std::string head("\xED\xA1\xDA\x01", 4);
  head += std::string(16, '\0') + std::string("\0\0\0\x0f", 4);
  for (int shift = 24; shift >= 0; shift -= 8) head += static_cast<char>(kClaimed >> shift);
  test::write_text(paths_.frames("cam01"), head + "V3D_FRAME_cam01");
  std::filesystem::resize_file(paths_.frames("cam01"), head.size() + 15 + kClaimed);
  rusage before{}, after{};
  getrusage(RUSAGE_SELF, &before);
  EXPECT_THAT(verify_take(paths_).disagreements,
              testing::Contains("cam01.lcmlog: 1 damaged events"));
  getrusage(RUSAGE_SELF, &after);
  EXPECT_LT(after.ru_maxrss - before.ru_maxrss, 50 << 10) << "kB";
}

TEST_F(VerifyTake, reports_pulses_that_were_not_sensed) {
  test::write_text(paths_.pulses(), "");
  EXPECT_THAT(verify_take(paths_).disagreements,
              ElementsAre("pulses.lcmlog: holds 0 pulses, the ledger says 3"));
}

TEST_F(VerifyTake, reports_a_wrong_ledger) {
  Ledger ledger = load_ledger(paths_.ledger());
  ledger.cameras[0].missing = {1};
  ledger.cameras.pop_back();
  EXPECT_TRUE(save_ledger(paths_.ledger(), ledger));
  EXPECT_THAT(
      verify_take(paths_).disagreements,
      ElementsAre(
          "cam01.lcmlog: its missing, duplicate or suspect pulses are not those of the ledger",
          "ledger.toml: has no camera 'cam02'"));
}

TEST_F(VerifyTake, lacks_no_known_frame_after_recovery_of_an_unclosed_take) {
  std::filesystem::remove(paths_.ledger());
  info_.state = TakeState::kRecording;
  info_.pulses = 0;
  EXPECT_TRUE(save_take_info(paths_, info_));
  EXPECT_THAT(verify_take(paths_).disagreements, ElementsAre(HasSubstr("ledger.toml: missing")));
  test::write_text(paths_.reserve(), "room");
  recover_take(paths_);
  EXPECT_FALSE(std::filesystem::exists(paths_.reserve()));
  const Verification after = verify_take(paths_);
  EXPECT_THAT(after.disagreements, IsEmpty());
  EXPECT_EQ(after.ledger.verdict(),
            "take kendo-07: incomplete, 2 cameras x at least 3 pulses, 0 missing, 0 suspect");
  EXPECT_EQ(after.info.state, TakeState::kRecovered);
  EXPECT_EQ(after.info.pulses, 3);
}

TEST_F(VerifyTake, reports_an_impossible_pulse_number) {
  std::filesystem::remove(paths_.ledger());
  info_.state = TakeState::kRecording;
  EXPECT_TRUE(save_take_info(paths_, info_));
  std::filesystem::remove(paths_.pulses());
  {
    EventLogWriter pulses(paths_.pulses());
    for (const int64_t pulse : {int64_t{0}, int64_t{1}, int64_t{2}, INT64_MAX - 1}) {
      wire::PulseMessage m;
      m.pulse = pulse;
      EXPECT_TRUE(pulses.write(m));
    }
  }
  const Verification v = verify_take(paths_);
  EXPECT_EQ(v.ledger.commanded, 3);
  EXPECT_THAT(v.disagreements,
              testing::Contains(HasSubstr("pulses.lcmlog: holds pulse 9,223,372,036,854,775,806")));
}

TEST_F(VerifyTake, reports_an_invalid_mesh_file) {
  test::write_text(paths_.mesh(), "mesh");
  EXPECT_THAT(verify_take(paths_).disagreements, ElementsAre(HasSubstr("is not a mesh file")));
}

void write_meshes(const std::filesystem::path& path, int64_t count) {
  std::filesystem::remove(path);
  MeshFileWriter meshes(path);
  for (int64_t pulse = 0; pulse < count; ++pulse) {
    EXPECT_TRUE(meshes.append(pulse, std::vector<uint8_t>(100, 1)));
  }
  EXPECT_TRUE(meshes.close());
}

TEST_F(VerifyTake, reports_a_proxy_that_does_not_belong_to_the_meshes) {
  write_meshes(paths_.proxy(), 3);
  EXPECT_THAT(verify_take(paths_).disagreements,
              ElementsAre(HasSubstr("proxy.v3d: is the proxy of a missing mesh.v3d")));
  write_meshes(paths_.mesh(), 2);
  EXPECT_THAT(verify_take(paths_).disagreements,
              ElementsAre(HasSubstr("proxy.v3d: has other pulses than mesh.v3d")));
  write_meshes(paths_.mesh(), 3);
  EXPECT_THAT(verify_take(paths_).disagreements, IsEmpty());
  test::write_text(paths_.proxy(), "proxy");
  EXPECT_THAT(verify_take(paths_).disagreements,
              ElementsAre(HasSubstr("proxy.v3d: is not a mesh file")));
}

/// The same take, with a file list in the ledger.
class VerifyListedTake : public VerifyTake {
 protected:
  VerifyListedTake() {
    test::write_text(paths_.calib(), "# the rig\n");
    test::write_text(paths_.studio(), "# the studio\n");
    std::filesystem::create_directories(paths_.background());
    test::write_text(paths_.background() / "cam01.mean.png", "plate");
    list({"cam01.lcmlog", "cam02.lcmlog"});
  }

  /// Writes the ledger again, with the checksums of `logs`.
  void list(const std::vector<std::string>& logs) {
    Ledger ledger = load_ledger(paths_.ledger());
    ledger.files.clear();
    EXPECT_TRUE(save_ledger(paths_.ledger(), ledger));
    for (const std::string& log : logs) {
      ledger.files.push_back(read_take_file(paths_, log, ReadFrom::kPageCache).value());
    }
    EXPECT_TRUE(save_account(paths_, info_, ledger));
  }

  void flip_a_bit(const std::string& file, size_t at) const {
    std::string bytes = read_file(paths_.folder / file);
    bytes.at(at) = static_cast<char>(bytes.at(at) ^ 1);
    test::write_text(paths_.folder / file, bytes);
  }
};

TEST_F(VerifyListedTake, is_whole_and_lists_every_file) {
  const Verification v = verify_take(paths_, ReadFrom::kDisk);
  EXPECT_THAT(v.disagreements, IsEmpty());
  EXPECT_THAT(v.notes, IsEmpty());
  std::vector<std::string> names;
  for (const TakeFile& file : v.files) names.push_back(file.name);
  EXPECT_THAT(names,
              ElementsAre("background/cam01.mean.png", "calib.toml", "cam01.lcmlog", "cam02.lcmlog",
                          "ledger.toml", "pulses.lcmlog", "studio.toml", "take.toml"));
}

TEST_F(VerifyListedTake, reports_a_file_with_a_changed_bit_and_both_checksums) {
  const Ledger ledger = load_ledger(paths_.ledger());
  // The changed byte is a digit of the start time in take.toml, of an event's time in
  // pulses.lcmlog, and of an event number in the camera log. No other check detects these changes.
  const size_t start = read_file(paths_.info()).find("started_ns = ") + 13;
  const std::map<std::string, size_t> places = {
      {"calib.toml", 3},    {"studio.toml", 3},    {"background/cam01.mean.png", 4},
      {"take.toml", start}, {"pulses.lcmlog", 15}, {"cam02.lcmlog", 11}};
  for (const auto& [file, place] : places) {
    flip_a_bit(file, place);
    const auto now = read_take_file(paths_, file, ReadFrom::kPageCache)->checksum;
    EXPECT_THAT(
        verify_take(paths_).disagreements,
        ElementsAre(file + ": has the checksum " + checksum_text(now.value()) +
                    ", the ledger says " + checksum_text(ledger.file(file)->checksum.value())));
    flip_a_bit(file, place);
  }
}

TEST_F(VerifyListedTake, reports_a_link_to_the_same_content_outside_of_the_take) {
  const test::TemporaryFolder outside;
  for (const char* file : {"calib.toml", "background/cam01.mean.png"}) {
    std::filesystem::copy_file(paths_.folder / file, outside / "copy");
    std::filesystem::remove(paths_.folder / file);
    std::filesystem::create_symlink(outside / "copy", paths_.folder / file);
    EXPECT_THAT(verify_take(paths_).disagreements,
                Contains(HasSubstr(std::string(file) + ": it is a symbolic link")));
    std::filesystem::rename(outside / "copy", paths_.folder / file);
  }
}

TEST_F(VerifyListedTake, reports_missing_and_shorter_files) {
  std::filesystem::remove(paths_.background() / "cam01.mean.png");
  test::write_text(paths_.studio(), "#");
  EXPECT_THAT(verify_take(paths_).disagreements,
              ElementsAre("studio.toml: has 1 bytes, the ledger says 13",
                          "background/cam01.mean.png: missing; the ledger lists it with 5 bytes"));
  std::filesystem::remove(paths_.frames("cam01"));
  EXPECT_THAT(verify_take(paths_).disagreements,
              testing::Contains(HasSubstr("cam01.lcmlog")).Times(2))
      << "one line for the log and one for its count";
}

/// Copies are compared with this checksum.
TEST_F(VerifyListedTake, has_the_checksum_of_all_bytes_of_a_file_that_the_ledger_lists_as_shorter) {
  test::write_text(paths_.frames("cam01"),
                   read_file(paths_.frames("cam01")) + std::string(100, 'x'));
  const Verification v = verify_take(paths_);
  EXPECT_THAT(v.disagreements,
              Contains(HasSubstr("cam01.lcmlog: has 607 bytes, the ledger says 507")));
  const auto found = std::ranges::find(v.files, "cam01.lcmlog", &TakeFile::name);
  ASSERT_NE(found, v.files.end());
  EXPECT_EQ(*found, read_take_file(paths_, "cam01.lcmlog", ReadFrom::kPageCache).value());
}

TEST_F(VerifyListedTake, reports_unlisted_parts_and_notes_other_files) {
  test::write_text(paths_.background() / "cam09.toml", "");
  test::write_text(paths_.folder / "notes.txt", "");
  test::write_text(paths_.slate(), "mark = ''\n");
  test::write_text(paths_.folder / ".cap01.lock", "");
  const Verification v = verify_take(paths_);
  EXPECT_THAT(v.disagreements,
              ElementsAre("background/cam09.toml: is not named in the ledger; move it out of the "
                          "take"));
  EXPECT_THAT(v.notes, ElementsAre("notes.txt: is not named in the ledger"));
}

TEST_F(VerifyListedTake, notes_a_file_whose_name_is_not_utf8_and_stays_verified) {
  test::write_text(paths_.folder / "M\xfcller.txt", "note");
  const Verification v = verify_take(paths_);
  EXPECT_THAT(v.disagreements, IsEmpty());
  EXPECT_THAT(v.notes, ElementsAre("M?ller.txt: its name is not UTF-8; it is not verified"));
  ASSERT_TRUE(save_verified(paths_, v));
  EXPECT_TRUE(load_verified(paths_));
  ASSERT_TRUE(save_account(paths_, info_, load_ledger(paths_.ledger())));
  EXPECT_THAT(verify_take(paths_).disagreements, IsEmpty()) << "a ledger would list another name";
}

TEST_F(VerifyListedTake, is_not_whole_with_a_truncated_mesh_file) {
  {
    MeshFileWriter meshes(paths_.mesh());
    for (int64_t pulse = 0; pulse < 3; ++pulse) {
      EXPECT_TRUE(meshes.append(pulse, std::vector<uint8_t>(100, 1)));
    }
    EXPECT_TRUE(meshes.close());
  }
  EXPECT_TRUE(verify_take(paths_).whole());
  std::filesystem::resize_file(paths_.mesh(), std::filesystem::file_size(paths_.mesh()) / 2);
  const Verification v = verify_take(paths_);
  EXPECT_FALSE(v.whole());
  EXPECT_THAT(v.disagreements, ElementsAre(HasSubstr("mesh.v3d: ends without its index")));
}

TEST_F(VerifyListedTake, counts_unreadable_meshes_apart_from_damaged_ones) {
  {
    MeshFileWriter meshes(paths_.mesh());
    for (int64_t pulse = 0; pulse < 3; ++pulse) {
      EXPECT_TRUE(meshes.append(pulse, std::vector<uint8_t>(10'000, 1)));
    }
    EXPECT_TRUE(meshes.close());
  }
  flip_a_bit("mesh.v3d", 5'000);
  const test::UnreadableByte bad(15'000, paths_.folder);
  const Verification v = verify_take(paths_);
  EXPECT_THAT(v.disagreements,
              ElementsAre("cannot read " + paths_.mesh().string() + ": Input/output error",
                          "cannot read " + paths_.mesh().string() + ": Input/output error",
                          "mesh.v3d: 1 meshes cannot be read", "mesh.v3d: 1 damaged meshes"))
      << "the first line is of the checksum of the file";
  EXPECT_THAT(v.read_errors, IsEmpty()) << "the ledger counts no meshes";
}

TEST_F(VerifyListedTake, is_not_whole_with_a_flipped_bit_in_its_ledger_until_recovered) {
  const std::string text = read_file(paths_.ledger());
  flip_a_bit("ledger.toml", text.find("received = ") + 11);
  const Verification damaged = verify_take(paths_);
  EXPECT_FALSE(damaged.whole());
  EXPECT_THAT(damaged.disagreements, Contains(HasSubstr("ledger.toml: damaged: the checksum")));
  const Verification recovered = recover_take(paths_);
  EXPECT_THAT(recovered.disagreements, Contains(HasSubstr("ledger.toml: damaged: the checksum")));
  EXPECT_NO_THROW(load_ledger(paths_.ledger()));
}

TEST_F(VerifyListedTake, accepts_a_ledger_of_an_older_version_with_a_note) {
  Ledger ledger = load_ledger(paths_.ledger());
  ledger.files.clear();
  EXPECT_TRUE(save_ledger(paths_.ledger(), ledger));
  flip_a_bit("calib.toml", 3);
  const Verification v = verify_take(paths_);
  EXPECT_TRUE(v.whole());
  EXPECT_THAT(v.notes, ElementsAre(HasSubstr("ledger.toml: has no checksums of files")));
}

TEST_F(VerifyListedTake, keeps_log_checksums_in_a_recovery_and_notes_logs_without) {
  list({"cam01.lcmlog"});
  info_.state = TakeState::kRecording;
  EXPECT_TRUE(save_take_info(paths_, info_));
  const std::optional<uint64_t> before =
      load_ledger(paths_.ledger()).file("cam01.lcmlog")->checksum;
  recover_take(paths_);
  EXPECT_EQ(load_ledger(paths_.ledger()).file("cam01.lcmlog")->checksum, before);
  const Verification v = verify_take(paths_);
  EXPECT_THAT(v.disagreements, IsEmpty());
  EXPECT_THAT(v.notes, ElementsAre("cam02.lcmlog: the ledger has no checksum of it, as after a "
                                   "recovery"));
}

TEST_F(VerifyListedTake,
       notes_sound_without_a_checksum_which_takes_collect_compares_with_the_node) {
  std::filesystem::create_directories(paths_.sound());
  test::write_text(paths_.sound() / "cap01.raw", "sound");
  Ledger ledger = load_ledger(paths_.ledger());
  for (TakeFile& file : ledger.files) {
    if (file.name == "cam02.lcmlog") file.checksum.reset();
  }
  ledger.files.push_back({.name = "sound/cap01.raw", .bytes = 5, .checksum = {}});
  ASSERT_TRUE(save_ledger(paths_.ledger(), ledger));
  EXPECT_THAT(
      verify_take(paths_).notes,
      Contains("sound/cap01.raw: the ledger has no checksum of it, as of sound above 4 GiB"));
  EXPECT_THAT(files_without_checksum(paths_), ElementsAre("sound/cap01.raw"));
}

TEST(EventLogWriter, has_the_checksum_of_the_bytes_on_disk) {
  const test::TemporaryFolder folder;
  const TakePaths paths{folder.path()};
  EventLogWriter log(paths.frames("cam01"));
  for (int64_t pulse = 0; pulse < 3; ++pulse) EXPECT_TRUE(log.write(frame_of("cam01", pulse)));
  TakeFile read = read_take_file(paths, "cam01.lcmlog", ReadFrom::kPageCache).value();
  read.changed_ns = 0;
  EXPECT_EQ(log.file(), read);
}

TEST(Verify, rejects_a_folder_that_is_not_a_take) {
  const test::TemporaryFolder folder;
  EXPECT_THAT(test::message_of<InputError>([&] { verify_take({folder.path()}); }),
              HasSubstr("take.toml is missing"));
}

}  // namespace
}  // namespace v3d::take
