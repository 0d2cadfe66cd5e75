// Power cuts: a log ends at any byte, with or without garbage after the end. The soak test cuts at
// every byte of the last megabyte, which takes minutes; otherwise every 487th byte is used.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <random>

#include "base/io/file.h"
#include "recording.h"
#include "support/begun_take.h"
#include "support/temporary_folder.h"
#include "take/ledger/verify.h"
#include "take/logs/event_log.h"
#include "take/logs/frame_log.h"
#include "take/logs/log_files.h"

namespace v3d::take {
namespace {

using testing::IsEmpty;

#ifdef V3D_SOAK
#define POWER_CUT PowerCutSoak
constexpr int64_t kStep = 1;
#else
#define POWER_CUT PowerCut
constexpr int64_t kStep = 487;
#endif

constexpr int64_t kMegabyte = 1'000'000;
constexpr ImageSize kSize{128, 64};
const std::string kCamera = "cam07";

/// A log slightly longer than a megabyte, with its length after each frame.
class Recording {
 public:
  Recording() {
    EventLogWriter writer(path());
    while (writer.bytes() <= kMegabyte + 20'000) {
      const auto pulse = static_cast<int64_t>(ends_.size());
      if (!writer.write(test::recorded_frame(kCamera, pulse, kSize))) break;
      ends_.push_back(writer.bytes());
    }
  }
  std::filesystem::path path() const { return folder_ / (kCamera + ".lcmlog"); }
  int64_t bytes() const { return ends_.back(); }
  /// Number of whole frames in the first `length` bytes.
  size_t whole_in(int64_t length) const {
    return static_cast<size_t>(std::upper_bound(ends_.begin(), ends_.end(), length) -
                               ends_.begin());
  }

 private:
  const test::TemporaryFolder folder_;
  std::vector<int64_t> ends_;
};

std::optional<int64_t> pulse_of(const EventLogReader& log, size_t event) {
  const auto bytes = log.read(log.events()[event]);
  const auto message = bytes ? wire::decode<wire::FrameMessage>(*bytes) : std::nullopt;
  return message ? std::optional(message->frame.label.pulse) : std::nullopt;
}

/// Expects every whole frame before the cut, and no other frame that can be decoded.
void expect_frames_before(const Recording& recording, int64_t cut) {
  const EventLogReader log(recording.path());
  const size_t whole = recording.whole_in(cut);
  ASSERT_GE(log.events().size(), whole) << "cut at " << cut;
  EXPECT_EQ(pulse_of(log, whole - 1), static_cast<int64_t>(whole) - 1) << "cut at " << cut;
  // Garbage in place of the end of a frame is detected by the frame's checksum.
  for (size_t event = whole; event < log.events().size(); ++event) {
    EXPECT_EQ(pulse_of(log, event), std::nullopt) << "cut at " << cut;
  }
}

TEST(POWER_CUT, at_any_byte_of_the_last_megabyte_loses_only_the_torn_frame) {
  const Recording recording;
  for (int64_t cut = recording.bytes(); cut > recording.bytes() - kMegabyte && !HasFailure();
       cut -= kStep) {
    std::filesystem::resize_file(recording.path(), static_cast<uintmax_t>(cut));
    expect_frames_before(recording, cut);
  }
}

TEST(POWER_CUT, followed_by_garbage_loses_only_the_torn_frame) {
  const Recording recording;
  std::mt19937 random(11);
  const int fd = open(recording.path().c_str(), O_RDWR | O_CLOEXEC);
  for (int64_t cut = recording.bytes(); cut > recording.bytes() - kMegabyte && !HasFailure();
       cut -= kStep) {
    std::array<uint8_t, 64> garbage{};
    for (uint8_t& byte : garbage) byte = static_cast<uint8_t>(random());
    uint8_t right = 0;
    if (pread(fd, &right, 1, cut) == 1 && garbage[0] == right) garbage[0] ^= 1U;
    if (ftruncate(fd, cut) != 0) FAIL();
    ASSERT_EQ(pwrite(fd, garbage.data(), garbage.size(), cut), 64);
    expect_frames_before(recording, cut);
  }
  close(fd);
}

#ifndef V3D_SOAK

/// A take of one camera that was not closed.
class PowerCutRecovery : public testing::Test {
 protected:
  PowerCutRecovery() {
    EXPECT_TRUE(save_take_info(paths_, test::begun_take({kCamera})));
    test::write_text(paths_.calib(), "");
    record();
    event_bytes_ = static_cast<int64_t>(std::filesystem::file_size(paths_.frames(kCamera))) / 10;
  }
  void record() const {
    EventLogWriter pulses(paths_.pulses());
    EventLogWriter frames(paths_.frames(kCamera));
    for (int64_t pulse = 0; pulse < 10; ++pulse) {
      wire::PulseMessage sensed;
      sensed.pulse = pulse;
      EXPECT_TRUE(pulses.write(sensed));
      EXPECT_TRUE(frames.write(test::recorded_frame(kCamera, pulse, kSize)));
    }
  }
  void resize(int64_t bytes) const {
    std::filesystem::resize_file(paths_.frames(kCamera), static_cast<uintmax_t>(bytes));
  }
  /// Expects that recovery keeps `frames` frames, that files and ledger agree, and that the log is
  /// unchanged.
  void expect_recovered(int64_t frames) const {
    const std::string before = read_file(paths_.frames(kCamera));
    EXPECT_EQ(recover_take(paths_).ledger.cameras[0].written, frames);
    const Verification verified = verify_take(paths_);
    EXPECT_EQ(verified.ledger.cameras[0].written, frames);
    EXPECT_THAT(verified.disagreements, IsEmpty());
    const auto bytes = std::filesystem::file_size(paths_.frames(kCamera));
    const auto index = load_segment_index(paths_.frames(kCamera), bytes).value();
    ASSERT_TRUE(index);
    EXPECT_EQ(static_cast<int64_t>(index->whole_bytes), frames * event_bytes_);
    EXPECT_EQ(index->events, frames);
    EXPECT_EQ(read_file(paths_.frames(kCamera)), before) << "recovery changes no byte";
  }

  const test::TemporaryFolder folder_;
  const TakePaths paths_{folder_.path()};
  int64_t event_bytes_ = 0;
};

TEST_F(PowerCutRecovery, keeps_all_frames_up_to_the_last_whole_one) {
  resize(7 * event_bytes_ + 1000);
  expect_recovered(7);
}

TEST_F(PowerCutRecovery, drops_frames_that_are_zeros_on_disk) {
  resize(8 * event_bytes_ + 500);
  resize(10 * event_bytes_);  // zeros
  expect_recovered(8);
}

TEST_F(PowerCutRecovery, drops_frames_that_have_their_length_but_not_their_bytes) {
  const int fd = open(paths_.frames(kCamera).c_str(), O_WRONLY | O_CLOEXEC);
  const std::vector<char> zeros(1000);
  for (const int64_t frame : {8, 9}) {
    pwrite(fd, zeros.data(), zeros.size(), frame * event_bytes_ + 2000);
  }
  close(fd);
  expect_recovered(8);
}

TEST_F(PowerCutRecovery, keeps_damaged_frames_before_whole_frames) {
  const int fd = open(paths_.frames(kCamera).c_str(), O_WRONLY | O_CLOEXEC);
  pwrite(fd, "!", 1, 3 * event_bytes_ + 2000);
  close(fd);
  recover_take(paths_);
  const Verification verified = verify_take(paths_);
  EXPECT_THAT(verified.ledger.cameras[0].missing, testing::ElementsAre(3));
  EXPECT_THAT(verified.disagreements, testing::Contains("cam07.lcmlog: 1 damaged events"));
}

TEST_F(PowerCutRecovery, returns_an_empty_log_when_no_frame_is_whole) {
  resize(event_bytes_ - 1);
  expect_recovered(0);
}

#endif

}  // namespace
}  // namespace v3d::take
