// Recovery of a take during faults of the disk or the process: no recorded byte is lost.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>

#include "base/core/error.h"
#include "base/io/file.h"
#include "recording.h"
#include "support/begun_take.h"
#include "support/message_of.h"
#include "support/open_faults.h"
#include "support/studio_text.h"
#include "support/temporary_folder.h"
#include "support/unreadable_byte.h"
#include "take/ledger/verify.h"
#include "take/logs/event_log.h"
#include "take/logs/frame_log.h"
#include "take/logs/mesh_file.h"
#include "take/take_files.h"

namespace v3d::take {
namespace {

using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

constexpr ImageSize kSize{64, 48};
constexpr int64_t kFrames = 20;
const std::string kCamera = "cam07";

/// A take of one camera that was not closed, with a torn event at its end.
class TakeRecovery : public testing::Test {
 protected:
  TakeRecovery() {
    EXPECT_TRUE(save_take_info(paths_, test::begun_take({kCamera})));
    test::write_text(paths_.calib(), "");
    EventLogWriter pulses(paths_.pulses());
    {
      EventLogWriter frames(log());
      for (int64_t pulse = 0; pulse <= kFrames; ++pulse) {
        wire::PulseMessage sensed;
        sensed.pulse = pulse;
        EXPECT_TRUE(pulses.write(sensed));
        EXPECT_TRUE(frames.write(test::recorded_frame(kCamera, pulse, kSize)));
      }
      event_bytes_ = frames.bytes() / (kFrames + 1);
    }
    std::filesystem::resize_file(log(), std::filesystem::file_size(log()) - 100);
    before_ = contents();
  }

  std::filesystem::path log() const { return paths_.frames(kCamera); }
  /// Contents of the event logs, by file name.
  std::map<std::string, std::string> contents() const {
    std::map<std::string, std::string> files;
    for (const auto& entry : std::filesystem::directory_iterator(paths_.folder)) {
      if (entry.path().extension() != ".lcmlog") continue;
      files[entry.path().filename()] = read_file(entry.path());
    }
    return files;
  }
  void expect_every_frame() const {
    FrameLogReader reader(log());
    for (int64_t pulse = 0; pulse < kFrames; ++pulse) {
      const auto frame = reader.read(pulse);
      ASSERT_TRUE(frame) << "pulse " << pulse;
      EXPECT_EQ(frame->image.bytes, test::recorded_frame(kCamera, pulse, kSize).frame.image.bytes);
    }
  }

  const test::TemporaryFolder folder_;
  const TakePaths paths_{folder_.path()};
  int64_t event_bytes_ = 0;
  std::map<std::string, std::string> before_;
};

TEST_F(TakeRecovery, reports_progress_while_it_reads) {
  int64_t reports = 0;
  recover_take(paths_, AfterReadErrors::kStayOpen, [&] { ++reports; });
  EXPECT_GE(reports, 3 * kFrames) << "for its index, for the events, and for their labels";
}

TEST_F(TakeRecovery, reads_no_meshes_because_they_may_be_gigabytes) {
  test::write_text(paths_.mesh(), "no mesh file");
  EXPECT_THAT(recover_take(paths_).disagreements,
              testing::Not(testing::Contains(HasSubstr("mesh"))));
}

TEST_F(TakeRecovery, keeps_every_frame_when_a_header_is_unreadable) {
  for (const int64_t event : {0, 1, 10, 19}) {
    {
      const test::UnreadableByte bad(event * event_bytes_ + 20);
      const Verification recovered = recover_take(paths_);
      EXPECT_THAT(recovered.disagreements,
                  Contains(HasSubstr("cannot read " + log().string() + ": Input/output error")));
      EXPECT_LT(recovered.ledger.cameras[0].written, kFrames);
      EXPECT_GT(recovered.ledger.cameras[0].written, kFrames - 8) << "later events are searched";
      EXPECT_THAT(recovered.read_errors, Not(IsEmpty()));
      EXPECT_EQ(load_take_info(paths_).state, TakeState::kRecording)
          << "the next start tries again";
      EXPECT_FALSE(std::filesystem::exists(paths_.ledger()));
    }
    EXPECT_EQ(contents(), before_) << "header of event " << event;
    expect_every_frame();
  }
}

TEST_F(TakeRecovery, closes_a_take_with_an_unreadable_header_on_request_of_an_operator) {
  const test::UnreadableByte bad(event_bytes_ + 20);
  recover_take(paths_, AfterReadErrors::kRecover);
  EXPECT_EQ(load_take_info(paths_).state, TakeState::kRecovered);
  EXPECT_FALSE(load_ledger(paths_.ledger()).cameras[0].missing.empty());
}

TEST_F(TakeRecovery, counts_a_recovered_take_again_when_its_disk_can_be_read_again) {
  {
    const test::UnreadableByte bad(event_bytes_ + 20);
    recover_take(paths_, AfterReadErrors::kRecover);
  }
  test::write_text(paths_.calib(), "changed");
  const Ledger ledger = recover_take(paths_).ledger;
  EXPECT_EQ(ledger.cameras[0].written, kFrames);
  EXPECT_EQ(load_ledger(paths_.ledger()).cameras[0].written, kFrames);
  EXPECT_THAT(verify_take(paths_).disagreements,
              Contains("calib.toml: has 7 bytes, the ledger says 0"));
}

TEST_F(TakeRecovery, cannot_count_pulses_after_the_last_one) {
  EXPECT_TRUE(recover_take(paths_).ledger.commanded_is_minimum);
  EXPECT_EQ(verify_take(paths_).ledger.verdict(),
            "take kendo-07: incomplete, 1 cameras x at least 21 pulses, 1 missing, 0 suspect");
}

/// The take of a node whose trigger has no sense line.
class TakeRecoveryWithoutSenseLine : public TakeRecovery {
 protected:
  TakeRecoveryWithoutSenseLine() {
    std::filesystem::remove(paths_.pulses());
    EventLogWriter(paths_.pulses());
    test::write_text(
        paths_.studio(),
        test::studio_text({{"cap01", {kCamera}}}, "kind = 'gpio'\nchip = 'gpiochip0'\nline = 17"));
  }
};

TEST_F(TakeRecoveryWithoutSenseLine, counts_the_pulses_up_to_the_last_frame_only) {
  const Ledger recovered = recover_take(paths_).ledger;
  EXPECT_EQ(recovered.commanded, kFrames);
  EXPECT_TRUE(recovered.commanded_is_minimum);
  EXPECT_FALSE(recovered.sensed);
  EXPECT_THAT(recovered.cameras[0].suspect, IsEmpty());
  EXPECT_THAT(recovered.cameras[0].missing, IsEmpty());
  EXPECT_FALSE(recovered.complete());
  EXPECT_THAT(recovered.verdict(), HasSubstr("incomplete, 1 cameras x at least 20 pulses"));
}

TEST_F(TakeRecoveryWithoutSenseLine, is_verified_and_joined_with_that_minimum) {
  recover_take(paths_);
  const Ledger verified = verify_take(paths_).ledger;
  EXPECT_TRUE(verified.commanded_is_minimum);
  Ledger trigger;
  trigger.commanded = kFrames + 3;
  const Ledger joined = merge({verified, trigger});
  EXPECT_FALSE(joined.commanded_is_minimum);
  EXPECT_THAT(joined.cameras[0].missing, ElementsAre(20, 21, 22));
  trigger.commanded = 0;
  EXPECT_TRUE(merge({verified, trigger}).commanded_is_minimum)
      << "an unreported node knows nothing";
}

TEST_F(TakeRecovery, keeps_every_frame_when_no_file_can_be_opened) {
  {
    const test::NoDescriptorsLeft none;
    EXPECT_THAT(test::message_of<std::runtime_error>([&] { recover_take(paths_); }),
                HasSubstr("Too many open files"));
  }
  EXPECT_EQ(contents(), before_);
  expect_every_frame();
}

TEST_F(TakeRecovery, reports_path_and_cause_when_its_log_cannot_be_opened) {
  std::filesystem::rename(log(), paths_.folder / "elsewhere");
  std::filesystem::create_directory(log());
  EXPECT_THAT(test::message_of<std::runtime_error>([&] { recover_take(paths_); }),
              HasSubstr("cannot read " + log().string() + ": it is not a regular file"));
  EXPECT_EQ(load_take_info(paths_).state, TakeState::kRecording) << "the next start tries again";
}

TEST_F(TakeRecovery, is_idempotent) {
  const Verification once = recover_take(paths_);
  const auto index = read_file(segment_index_path(log()));
  const auto ledger = read_file(paths_.ledger());
  const Verification twice = recover_take(paths_);
  EXPECT_EQ(once.ledger.cameras[0].written, kFrames);
  EXPECT_EQ(twice.ledger.cameras[0].written, kFrames);
  EXPECT_EQ(read_file(segment_index_path(log())), index);
  EXPECT_EQ(read_file(paths_.ledger()), ledger);
  EXPECT_EQ(contents(), before_);
}

TEST_F(TakeRecovery, keeps_the_ledger_of_a_closed_take_that_another_version_wrote) {
  recover_take(paths_);
  std::string text = read_file(paths_.ledger());
  text.erase(0, text.find('\n') + 1);
  const std::string later = with_checksum("of_a_later_version = 1\n" + text);
  test::write_text(paths_.ledger(), later);
  EXPECT_THAT(test::message_of<std::runtime_error>([&] { recover_take(paths_); }),
              HasSubstr("ledger.toml: has unknown contents, but the right checksum"));
  EXPECT_EQ(read_file(paths_.ledger()), later);

  test::write_text(paths_.ledger(), "xxh3 = '0'\n" + text);
  recover_take(paths_);
  EXPECT_EQ(verify_take(paths_).ledger.cameras[0].written, kFrames) << "a damaged one is replaced";
}

TEST_F(TakeRecovery, keeps_the_ledger_of_a_closed_take_that_cannot_be_read_now) {
  recover_take(paths_);
  const std::string ledger = read_file(paths_.ledger());
  std::filesystem::rename(paths_.ledger(), paths_.folder / "elsewhere");
  std::filesystem::create_directory(paths_.ledger());
  EXPECT_THAT(test::message_of<std::runtime_error>([&] { recover_take(paths_); }),
              HasSubstr("the take is closed, and its ledger is kept"));
  EXPECT_TRUE(std::filesystem::is_directory(paths_.ledger()));
  EXPECT_EQ(read_file(paths_.folder / "elsewhere"), ledger);
}

TEST_F(TakeRecovery, is_followed_by_a_new_segment_that_is_verified_as_one_log) {
  recover_take(paths_);
  {
    EventLogWriter frames(log(), LogOpening::kContinue);
    EXPECT_EQ(frames.path(), segment_path(log(), 1));
    for (const int64_t pulse : {kFrames, kFrames + 1}) {
      EXPECT_TRUE(frames.write(test::recorded_frame(kCamera, pulse, kSize)));
    }
  }
  EXPECT_EQ(read_file(log()), before_.at("cam07.lcmlog"));
  const EventLogReader joined(log());
  EXPECT_EQ(joined.events().size(), static_cast<size_t>(kFrames) + 2);
  EXPECT_EQ(joined.torn_bytes(), 0) << "the index excludes the torn event";
  const Verification whole = verify_take(paths_);
  EXPECT_EQ(whole.ledger.cameras[0].written, kFrames + 2);
}

/// Damage of an index must not hide events.
TEST_F(TakeRecovery, searches_the_whole_segment_when_its_index_is_damaged) {
  recover_take(paths_);
  const std::filesystem::path file = segment_index_path(log());
  const std::string index = read_file(file);
  std::string fewer = index;  // hides all but the first event
  const size_t at = fewer.find("whole_bytes = ") + 14;
  fewer.replace(at, fewer.find('\n', at) - at, std::to_string(event_bytes_));
  test::write_text(file, fewer);

  expect_every_frame();
  const Verification found = verify_take(paths_);
  EXPECT_EQ(found.ledger.cameras[0].written, kFrames);
  EXPECT_THAT(found.notes,
              Contains(testing::AllOf(HasSubstr("cam07.lcmlog.index: damaged: the checksum"),
                                      HasSubstr("the whole segment was searched for events"))));
  const Verification again = recover_take(paths_);
  EXPECT_THAT(again.notes, Contains(HasSubstr("the index was made again")));
  EXPECT_EQ(read_file(file), index);
  EXPECT_THAT(verify_take(paths_).notes, Not(Contains(HasSubstr(".index"))));
  EXPECT_EQ(contents(), before_);
}

TEST_F(TakeRecovery, joins_segments_across_a_gap_in_their_numbers) {
  recover_take(paths_);
  {
    EventLogWriter second(log(), LogOpening::kContinue);
    EXPECT_TRUE(second.write(test::recorded_frame(kCamera, kFrames, kSize)));
  }
  std::filesystem::rename(segment_path(log(), 1), segment_path(log(), 3));
  EXPECT_EQ(EventLogReader(log()).events().size(), static_cast<size_t>(kFrames) + 1);
  EXPECT_EQ(next_segment(log(), existing_segments(log()).value()), segment_path(log(), 4));
}

TEST_F(TakeRecovery, includes_pulses_recorded_after_an_earlier_recovery) {
  recover_take(paths_);
  TakeInfo info = load_take_info(paths_);
  info.state = TakeState::kRecording;
  ASSERT_TRUE(save_take_info(paths_, info));
  {
    EventLogWriter pulses(paths_.pulses(), LogOpening::kContinue);
    EventLogWriter frames(log(), LogOpening::kContinue);
    for (const int64_t pulse : {kFrames + 1, kFrames + 2}) {
      wire::PulseMessage sensed;
      sensed.pulse = pulse;
      EXPECT_TRUE(pulses.write(sensed));
      EXPECT_TRUE(frames.write(test::recorded_frame(kCamera, pulse, kSize)));
    }
  }
  const Ledger ledger = recover_take(paths_).ledger;
  EXPECT_EQ(ledger.commanded, kFrames + 3);
  EXPECT_EQ(ledger.cameras[0].written, kFrames + 2);
  EXPECT_THAT(ledger.cameras[0].missing, ElementsAre(kFrames)) << "it was torn";
  EXPECT_THAT(ledger.cameras[0].suspect, testing::IsEmpty());
}

TEST_F(TakeRecovery, reports_unreadable_frames) {
  recover_take(paths_);
  const test::UnreadableByte bad(10 * event_bytes_ + 2000);  // inside the pixels of a frame
  const Verification found = verify_take(paths_);
  EXPECT_THAT(found.disagreements, Contains("cam07.lcmlog: 1 events cannot be read"));
  EXPECT_THAT(found.ledger.cameras[0].missing, ElementsAre(10, kFrames));
}

TEST(MeshFileRecovery, changes_no_byte_when_a_record_is_unreadable) {
  const test::TemporaryFolder folder;
  const std::filesystem::path path = folder / "mesh.v3d";
  {
    MeshFileWriter file(path);
    for (int64_t pulse = 0; pulse < 5; ++pulse) {
      EXPECT_TRUE(file.append(pulse, std::vector<uint8_t>(100, 7)));
    }
  }
  std::filesystem::resize_file(path, 16 + 5 * 124);  // killed before the index
  const std::string before = read_file(path);
  {
    const test::UnreadableByte bad(16 + 124 + 10);  // in the head of the second record
    EXPECT_THROW(MeshFileWriter(path, LogOpening::kContinue), InputError);
  }
  EXPECT_EQ(read_file(path), before);
  EXPECT_EQ(MeshFileReader(path).pulses().size(), 5U);
}

}  // namespace
}  // namespace v3d::take
