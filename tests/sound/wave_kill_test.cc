// A recording program is killed at random moments. It acknowledges every block that was written.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/prctl.h>
#include <unistd.h>

#include <csignal>
#include <cstdlib>
#include <random>

#include "sound/wave_file.h"
#include "support/temporary_folder.h"
#include "support/wait_for_child.h"

namespace v3d::sound {
namespace {

constexpr int kDefaultKills = 100;
constexpr WaveFormat kFormat{.rate_hz = 48'000, .channels = 2};
constexpr int64_t kBlock = 480;  ///< samples: 10 ms

/// More kills: V3D_WAVE_KILLS=1000.
int kills() {
  const char* const text = std::getenv("V3D_WAVE_KILLS");
  return text == nullptr ? kDefaultKills : std::atoi(text);
}

/// The value of both channels of a sample.
int32_t value_at(int64_t sample) { return static_cast<int32_t>(sample % 8'000'000) << 8; }

constexpr WaveTimecode kTimecode{.rate = TimecodeRate::k30, .samples_since_midnight = 12'345};
constexpr int kNeverFinish = 0;

/// Records without an end, or ends the file after `finish_at` acknowledgements.
[[noreturn]] void record(const std::filesystem::path& path, int finish_at, int acknowledge) {
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  auto writer = WaveWriter::create(path, kFormat, {});
  if (!writer) _exit(1);
  for (int blocks = 1;; ++blocks) {
    std::vector<int32_t> block;
    for (int64_t s = 0; s < kBlock; ++s)
      block.insert(block.end(), 2, value_at(writer->samples() + s));
    if (!writer->write(block)) _exit(1);
    const int64_t written = writer->samples();
    if (write(acknowledge, &written, sizeof written) != sizeof written) _exit(1);
    if (blocks == finish_at) _exit(writer->finish(kTimecode) ? 0 : 1);
  }
}

/// Runs the program, and kills it `after` its acknowledgement number `kill_at`. Returns the number
/// of samples that it acknowledged. Fails the test when the program ends by itself before
/// `finish_at`.
int64_t record_and_kill(const std::filesystem::path& path, int kill_at, Duration after,
                        int finish_at = kNeverFinish) {
  int channel[2];
  if (pipe2(channel, O_CLOEXEC) != 0) {
    ADD_FAILURE() << "pipe2() failed";
    return -1;
  }
  const pid_t child = fork();
  if (child == 0) {
    close(channel[0]);
    record(path, finish_at, channel[1]);
  }
  close(channel[1]);
  int64_t acknowledged = 0, written = 0;
  int received = 0;
  while (read(channel[0], &written, sizeof written) == sizeof written) {
    acknowledged = written;
    if (++received != kill_at) continue;
    const MonotonicInstant then = Monotonic::now() + after;
    while (Monotonic::now() < then) {
    }
    kill(child, SIGKILL);
  }
  close(channel[0]);
  const int status = test::wait_for_child(child);
  const bool has_finished = finish_at != kNeverFinish && status == 0;
  EXPECT_TRUE(status == test::kKilled || has_finished) << "the program ended with " << status;
  EXPECT_GE(received, kill_at);
  return acknowledged;
}

TEST(KilledWaveFile, is_readable_and_holds_every_acknowledged_sample) {
  std::mt19937 random(27);
  for (int i = 0; i < kills() && !HasFailure(); ++i) {
    SCOPED_TRACE("kill " + std::to_string(i));
    const test::TemporaryFolder folder;
    const int kill_at = 1 + static_cast<int>(random() % 64);
    const int64_t acknowledged =
        record_and_kill(folder / "a.wav", kill_at, std::chrono::microseconds(random() % 300));
    auto reader = WaveReader::open(folder / "a.wav");
    ASSERT_TRUE(reader) << reader.error().message;
    ASSERT_EQ(reader->format(), kFormat);
    ASSERT_GE(reader->samples(), acknowledged);
    const auto values = reader->read(0, reader->samples());
    ASSERT_TRUE(values);
    ASSERT_EQ(values->size(), static_cast<size_t>(2 * reader->samples()));
    for (int64_t s = 0; s < reader->samples(); ++s) {
      ASSERT_EQ((*values)[static_cast<size_t>(2 * s)], value_at(s)) << "sample " << s;
    }
  }
}

TEST(KilledWaveFile, has_its_old_or_its_new_time_reference_when_its_end_is_killed) {
  std::mt19937 random(28);
  for (int i = 0; i < kills() && !HasFailure(); ++i) {
    SCOPED_TRACE("kill " + std::to_string(i));
    const test::TemporaryFolder folder;
    constexpr int kBlocks = 3;
    const int64_t acknowledged = record_and_kill(
        folder / "a.wav", kBlocks, std::chrono::microseconds(random() % 200), kBlocks);
    ASSERT_EQ(acknowledged, kBlocks * kBlock);
    auto reader = WaveReader::open(folder / "a.wav");
    ASSERT_TRUE(reader) << reader.error().message;
    ASSERT_EQ(reader->samples(), acknowledged);
    const bool has_timecode = reader->origin().timecode_rate == kTimecode.rate;
    ASSERT_EQ(reader->origin().samples_since_midnight,
              has_timecode ? kTimecode.samples_since_midnight : 0);
  }
}

}  // namespace
}  // namespace v3d::sound
