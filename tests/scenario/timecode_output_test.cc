// The timecode that the real daemon plays on ALSA's device `file`, beside that of its takes.
#include <gmock/gmock.h>
#include <signal.h>

#include <chrono>
#include <cmath>
#include <cstring>
#include <fstream>

#include "sound/ltc.h"
#include "sound/timecode.h"
#include "studio4.h"
#include "take/logs/frame_log.h"
#include "take/take_sound.h"

namespace v3d::test {
namespace {

using testing::Ge;
using testing::SizeIs;

constexpr int kRate = 48'000;
constexpr int64_t kPulses = 60;
constexpr int kAttempts = 10;

/// Sets the environment that preloads v3d_sound_writes into daemons started during its lifetime.
struct SoundWritesPreloaded {
  SoundWritesPreloaded() {
    setenv("LD_PRELOAD", V3D_SOUND_WRITES_LIBRARY, 1);
    setenv("V3D_SOUND_WRITES", writes().c_str(), 1);
  }
  ~SoundWritesPreloaded() {
    unsetenv("LD_PRELOAD");
    unsetenv("V3D_SOUND_WRITES");
  }
  std::filesystem::path writes() const { return output_ / "writes"; }
  std::filesystem::path played() const { return output_ / "played.raw"; }

 protected:
  const TemporaryFolder output_;
};

/// A device that plays by the clock of the host, and timecode of 25 frames a second beside 20
/// pulses a second.
class TimecodeStudio : protected SoundWritesPreloaded, public Studio4 {
 protected:
  TimecodeStudio()
      : Studio4({.more = "[[sound]]\nnode = 'cap01'\nchannels = 2\npulse_channel = 2\n"
                         "device = 'simulated:ppm=80'\n"
                         "[timecode_output]\nstart = '10:00:00:00'\ndevice = 'file:" +
                         played().string() + ",raw'\n"}) {}

  /// When the device started to play, if it is known within 1 ms and the device had samples all the
  /// time since then. On a busy machine the daemon may be stopped for longer:
  /// v3d::sound::AlsaOutput reads the clock between its first write and its first question for the
  /// delay, and after 0.2 s without a write the timecode is interrupted.
  std::optional<MonotonicInstant> start_of_playing() const {
    std::ifstream lines(writes());
    std::vector<MonotonicInstant> instants;
    int64_t ns = 0, frames = 0, before = 0;
    for (; lines >> ns >> frames; before = frames) {
      instants.push_back(from_ns<Monotonic>(ns));
      const double played = to_seconds(instants.back() - instants.front()) * kRate;
      if (played > static_cast<double>(before) && before > 0) return {};
    }
    if (instants.size() < 2 || instants[1] - instants[0] > std::chrono::milliseconds(1)) return {};
    return instants[0];
  }
  /// The timecode of the first of the two channels of 32 bits that were played.
  sound::TimecodeTrack played_timecode() const {
    const std::string bytes = read_file(played());
    std::vector<float> samples;
    for (size_t at = 0; at + 8 <= bytes.size(); at += 8) {
      int32_t value = 0;
      std::memcpy(&value, bytes.data() + at, sizeof value);
      samples.push_back(static_cast<float>(value / 2147483648.0));
    }
    sound::LtcReader reader(kRate);
    sound::TimecodeTrack track(kRate, sound::TimecodeRate::k25);
    for (const sound::LtcFrame& frame : reader.push(samples)) track.add(frame);
    return track;
  }
  /// Records a take and ends the daemon. Returns when the device started to play; empty: the
  /// machine was too busy.
  std::optional<MonotonicInstant> record(const std::string& name) {
    take_name_ = name;
    arm_and_start(kPulses);
    EXPECT_TRUE(becomes_idle()) << log();
    underruns_ = value("cap01", "timecode_output_underruns");
    captured_->signal(SIGTERM);
    EXPECT_EQ(captured_->wait(within(30)), 0) << log();
    return start_of_playing();
  }
  void restart_captured() {
    std::filesystem::remove(writes());
    std::filesystem::remove(played());
    start_captured();
    client_.emplace(studio_);  // without the health of the ended daemon
  }

  double underruns_ = -1;  ///< of the timecode output, at the end of the last take
};

TEST_F(TimecodeStudio, plays_at_every_pulse_the_timecode_that_the_ledger_has_for_it) {
  ASSERT_TRUE(reaches("cap01", "timecode_output_open_flag", 1)) << log();
  std::optional<MonotonicInstant> start;
  for (int attempt = 1; !start && attempt <= kAttempts; ++attempt) {
    if (attempt > 1) restart_captured();
    ASSERT_TRUE(reaches("cap01", "sound_open_flag", 1)) << log();
    start = record("kendo-" + std::to_string(attempt));
  }
  ASSERT_TRUE(start) << "the daemon was stopped for a while in each of the takes";
  EXPECT_EQ(underruns_, 0);

  const sound::TimecodeTrack played = played_timecode();
  EXPECT_EQ(played.jumps(), 0);
  const take::TakeTimecode ledger(take());
  const auto pulses = take::read_pulses(take().pulses());
  ASSERT_THAT(pulses, SizeIs(Ge(kPulses)));
  for (const wire::PulseMessage& pulse : pulses) {
    const double sample = to_seconds(pulse.edge_monotonic - *start) * kRate;
    const auto heard =
        sound::timecode_frames_at(played.runs(), sound::TimecodeRate::k25, kRate, sample);
    const auto stated = ledger.at(pulse.pulse);
    ASSERT_TRUE(heard && stated) << pulse.pulse;
    EXPECT_NEAR(stated->frames, *heard, 0.1) << "frames, at pulse " << pulse.pulse;
  }
  const double first = ledger.at(0)->frames;
  EXPECT_NEAR(ledger.at(kPulses - 1)->frames - first, (kPulses - 1) * 25.0 / 20, 0.01);
  EXPECT_NEAR(first / 25, 10 * 3600, 300) << "the timecode counts from 10:00:00:00";
}

class AbsentTimecodeStudio : public Studio4 {
 protected:
  AbsentTimecodeStudio()
      : Studio4({.more = "[timecode_output]\ndevice = 'hw:CARD=NoSuchCard'\n"}) {}
};

TEST_F(AbsentTimecodeStudio, records_its_take_and_states_the_fault) {
  EXPECT_TRUE(becomes_true(
      [&] { return log().find("cannot open hw:CARD=NoSuchCard") != std::string::npos; },
      within(60)))
      << "an event names the device";
  EXPECT_TRUE(
      becomes_true([&] { return value("cap01", "timecode_output_open_flag") == 0; }, within(60)));
  arm_and_start(kPulses);
  ASSERT_TRUE(becomes_idle()) << log();
  EXPECT_EQ(load_take_info(take()).state, take::TakeState::kComplete);
}

}  // namespace
}  // namespace v3d::test
