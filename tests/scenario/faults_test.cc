// Scenario tests of faulty cameras: the simulated cameras play fault scripts against the real
// daemons. The expected ledger follows from the script and from the simulator's record of the sent
// images.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>
#include <nlohmann/json.hpp>
#include <set>

#include "daemon/bus/bus.h"
#include "sim/cameras/exposure_record.h"
#include "studio4.h"
#include "take/ledger/verify.h"
#include "take/logs/frame_log.h"
#include "v3d-sim/sim_commands.h"
#include "wire/messages.h"

namespace v3d {
namespace {

using test::becomes_true;
using test::kEmptyPulses;
using test::Studio4;
using test::within;
using testing::AllOf;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::IsSubsetOf;
using testing::IsSupersetOf;

using Pulses = std::vector<int64_t>;

/// The TOML table [[fault]] of one fault of cam02.
std::string fault(int64_t pulse, const std::string& kind, const std::string& more = "") {
  return "[[fault]]\ncamera = \"cam02\"\npulse = " + std::to_string(pulse) + "\nkind = \"" + kind +
         "\"\n" + more + "\n";
}

Pulses range(int64_t first, int64_t last) {
  Pulses pulses;
  for (int64_t pulse = first; pulse <= last; ++pulse) pulses.push_back(pulse);
  return pulses;
}

constexpr int64_t kPulses = 25;

/// Hz, of stories in which the arrival decides the number of a suspect frame: a busy machine reads
/// frames in less than half a period.
constexpr char kSlow[] = "2";

/// Pulse of a fault after which the arrival alone decides. It does so after eight frames on time
/// (capture/sync/pulse_matcher.cc). A busy machine delivers some of the earlier frames late.
constexpr int64_t kArrivalsKnown = 16;

/// A studio whose cam02 has the faults. 10 Hz, so that a busy machine loses no other frame.
class FaultyStudio : public Studio4 {
 protected:
  explicit FaultyStudio(const std::string& faults, const std::string& rate_hz = "10")
      : Studio4({.faults = faults, .rate = rate_hz}), bus_(studio_.network.lcm_url) {}

  void SetUp() override { events_.emplace(bus_, wire::kEventChannel, 1024); }

  /// Records a take of `pulses` pulses to its end.
  void record(int64_t pulses) {
    arm_and_start(pulses);
    ASSERT_TRUE(becomes_idle()) << log();
    stop();
  }

  /// Records until cam02 has delivered `frames` certain frames after its fault at `pulse`.
  void run_until_back(int64_t pulse, int64_t frames) {
    arm_and_start(0);
    const auto is_back = [&] {
      const double all = value("cap01", "cam02.frames");
      return all - value("cap01", "cam02.frames_suspect") >= static_cast<double>(pulse + frames);
    };
    ASSERT_TRUE(becomes_true(is_back, within(60))) << log();
  }
  void record_until_back(int64_t pulse, int64_t frames) {
    run_until_back(pulse, frames);
    stop();
  }

  void stop() {
    stop_and_check();
    EXPECT_EQ(faulty().missing, not_sent("cam02"));
  }

  /// Stops the take and compares it with the simulator's record.
  void stop_and_check() {
    const control::Answer stopped = command(wire::CommandVerb::kStop);
    ASSERT_TRUE(stopped.done()) << text_of(stopped) << log();
    verified_ = verify_take(take());
    EXPECT_THAT(verified_.disagreements, IsEmpty());
    EXPECT_EQ(verified_.info.state, take::TakeState::kComplete);
    EXPECT_EQ(verified_.ledger.sensed, verified_.ledger.commanded);
    exposures_ = sim::load_exposures(folder_ / "exposures.csv");
    check_ = sim::check_take(take().folder, exposures_);
    EXPECT_EQ(check_.mislabelled_not_suspect, 0) << testing::PrintToString(check_.problems);
    EXPECT_EQ(check_.frames_repeated, 0) << testing::PrintToString(check_.problems);
    EXPECT_EQ(check_.images_wrong, 0) << testing::PrintToString(check_.problems);
    for (const take::CameraLedger& camera : verified_.ledger.cameras) {
      if (camera.name == "cam02") continue;
      EXPECT_THAT(camera.missing, IsEmpty()) << camera.name;
      EXPECT_THAT(camera.duplicate, IsEmpty()) << camera.name;
      EXPECT_THAT(camera.suspect, IsEmpty()) << camera.name;
    }
  }

  /// Pulses of which this camera sent no image, by the simulator's record.
  Pulses not_sent(const std::string& camera) const {
    std::set<int64_t> sent;
    for (const sim::ExposureLine& line : exposures_) {
      if (line.camera == camera) sent.insert(line.edge - first_edge_);
    }
    Pulses pulses;
    for (int64_t pulse = 0; pulse < verified_.ledger.commanded; ++pulse) {
      if (!sent.contains(pulse)) pulses.push_back(pulse);
    }
    return pulses;
  }

  const take::CameraLedger& faulty() const { return verified_.ledger.cameras.at(1); }
  std::string verdict() const { return verified_.ledger.verdict(); }

  /// Expects that one gap of at least `pulses` pulses begins at `first`: the camera thaws with its
  /// old stream, and frames that it sends while it is reopened are lost. The frames after the gap
  /// may be suspect: a camera that was not reopened counts on, which contradicts its clock, and on
  /// a busy machine the arrival does not settle it at once. On such a machine, the camera may also
  /// thaw before it is reopened; frames are then lost after suspect ones. Some later frame is
  /// certain.
  void expect_one_gap_from(int64_t first, size_t pulses) const {
    Pulses uncertain = faulty().missing;
    EXPECT_GE(uncertain.size(), pulses);
    EXPECT_THAT(uncertain,
                testing::IsSupersetOf(range(first, first + static_cast<int64_t>(pulses) - 1)));
    const Pulses& suspect = faulty().suspect;
    uncertain.insert(uncertain.end(), suspect.begin(), suspect.end());
    std::ranges::sort(uncertain);
    const int64_t end = first + std::ssize(uncertain);
    EXPECT_EQ(uncertain, range(first, end - 1));
    EXPECT_LT(end, verified_.ledger.commanded);
  }

  /// Texts of all events about cam02 until now.
  std::vector<std::string> reported() {
    while (const auto event = events_->wait(Monotonic::now())) {
      if (event->subject == "cam02") reported_.push_back(event->text);
    }
    return reported_;
  }
  /// Waits up to 30 s for an event about cam02 that holds `text`. False at timeout.
  bool reports(const std::string& text) {
    return becomes_true(
        [&] {
          const std::vector<std::string> all = reported();
          return std::ranges::any_of(
              all, [&](const std::string& line) { return line.find(text) != std::string::npos; });
        },
        within(30));
  }

  int64_t first_edge_ = kEmptyPulses;  ///< edge of pulse 0 of the take
  bus::Bus bus_;
  std::optional<bus::Subscription<wire::EventMessage>> events_;
  std::vector<std::string> reported_;
  take::Verification verified_;
  std::vector<sim::ExposureLine> exposures_;
  sim::TakeCheck check_;
};

class DroppedFrames : public FaultyStudio {
 protected:
  DroppedFrames() : FaultyStudio(fault(10, "drop") + fault(11, "drop") + fault(20, "drop")) {}
};
TEST_F(DroppedFrames, are_listed_as_missing_and_make_no_other_frame_suspect) {
  record(kPulses);
  EXPECT_THAT(faulty().missing, ElementsAre(10, 11, 20));
  EXPECT_THAT(faulty().duplicate, IsEmpty());
  EXPECT_THAT(faulty().suspect, IsEmpty());
  EXPECT_EQ(verdict(), "take kendo-07: incomplete, 4 cameras x 25 pulses, 3 missing, 0 suspect");
}

/// 2 Hz: without the frame of pulse 0, the arrival decides the first number.
class DroppedFirstFrame : public FaultyStudio {
 protected:
  DroppedFirstFrame() : FaultyStudio(fault(0, "drop"), kSlow) {}
};
TEST_F(DroppedFirstFrame, is_listed_as_missing_and_makes_no_other_frame_suspect) {
  record(kPulses);
  EXPECT_THAT(faulty().missing, ElementsAre(0));
  EXPECT_THAT(faulty().suspect, IsEmpty());
  EXPECT_EQ(check_.frames_mislabelled, 0) << testing::PrintToString(check_.problems);
  EXPECT_EQ(verdict(), "take kendo-07: incomplete, 4 cameras x 25 pulses, 1 missing, 0 suspect");
}

class DroppedLastFrame : public FaultyStudio {
 protected:
  DroppedLastFrame() : FaultyStudio(fault(kPulses - 1, "drop")) {}
};
TEST_F(DroppedLastFrame, is_listed_as_missing_and_makes_no_frame_of_the_next_take_suspect) {
  record(kPulses);
  EXPECT_THAT(faulty().missing, ElementsAre(kPulses - 1));
  EXPECT_THAT(faulty().suspect, IsEmpty());
  take_name_ = "kendo-08";
  first_edge_ += kPulses;
  record(kPulses);
  EXPECT_TRUE(verified_.whole()) << verdict();
}

class MissedFirstTrigger : public FaultyStudio {
 protected:
  MissedFirstTrigger() : FaultyStudio(fault(0, "missed")) {}
};
TEST_F(MissedFirstTrigger, makes_all_frames_of_this_camera_suspect) {
  arm_and_start(kPulses);
  ASSERT_TRUE(becomes_idle()) << log();
  stop_and_check();
  EXPECT_EQ(faulty().missing.size(), 1U);
  EXPECT_EQ(faulty().suspect.size(), kPulses - 1U);
}

class MissedTrigger : public FaultyStudio {
 protected:
  MissedTrigger() : FaultyStudio(fault(10, "missed"), kSlow) {}
};
TEST_F(MissedTrigger, is_listed_as_missing_and_makes_the_next_frame_suspect) {
  record(kPulses);
  EXPECT_THAT(faulty().missing, ElementsAre(10));
  EXPECT_THAT(faulty().duplicate, IsEmpty());
  // A busy machine may deliver a frame late, which makes it suspect, too.
  EXPECT_THAT(faulty().suspect, AllOf(Contains(11), IsSubsetOf({11, 12, 13})));
  EXPECT_EQ(check_.frames_mislabelled, 0) << testing::PrintToString(check_.problems);
  EXPECT_EQ(verdict(), "take kendo-07: incomplete, 4 cameras x 25 pulses, 1 missing, " +
                           std::to_string(faulty().suspect.size()) + " suspect");
}

class DuplicatedFrame : public FaultyStudio {
 protected:
  DuplicatedFrame() : FaultyStudio(fault(kArrivalsKnown, "duplicate"), kSlow) {}
};
TEST_F(DuplicatedFrame, is_listed_and_makes_its_pulse_and_the_next_suspect) {
  record(kPulses);
  EXPECT_EQ(faulty().written, kPulses + 1);
  EXPECT_THAT(faulty().missing, IsEmpty());
  EXPECT_THAT(faulty().duplicate, ElementsAre(kArrivalsKnown));
  // A busy machine may deliver a frame late, which makes it suspect, too.
  EXPECT_THAT(faulty().suspect, AllOf(IsSupersetOf(range(kArrivalsKnown, kArrivalsKnown + 1)),
                                      IsSubsetOf(range(kArrivalsKnown, kArrivalsKnown + 3))));
  EXPECT_EQ(check_.frames_mislabelled, 0) << testing::PrintToString(check_.problems);
  EXPECT_EQ(verdict(), "take kendo-07: incomplete, 4 cameras x 25 pulses, 0 missing, " +
                           std::to_string(faulty().suspect.size()) + " suspect, 1 duplicate");
}

/// The camera sends as many frames as there are pulses before it sends the last one.
class DuplicatedFrameAndLateLastFrame : public FaultyStudio {
 protected:
  DuplicatedFrameAndLateLastFrame()
      : FaultyStudio(fault(kArrivalsKnown, "duplicate") + fault(kPulses - 1, "delay", "ms = 500"),
                     kSlow) {}
};
TEST_F(DuplicatedFrameAndLateLastFrame, have_a_frame_of_each_pulse) {
  record(kPulses);
  EXPECT_EQ(faulty().written, kPulses + 1);
  EXPECT_THAT(faulty().missing, IsEmpty());
  EXPECT_THAT(faulty().duplicate, ElementsAre(kArrivalsKnown));
}

/// The camera is silent for 650 ms: longer than three pulses, shorter than the second after which
/// it is reopened.
class DelayedFrames : public FaultyStudio {
 protected:
  DelayedFrames() : FaultyStudio(fault(10, "delay", "ms = 550")) {}
};
TEST_F(DelayedFrames, keep_their_pulses_and_the_pause_is_reported) {
  record(kPulses);
  EXPECT_TRUE(verified_.whole()) << verdict();
  EXPECT_EQ(verdict(), "take kendo-07: complete, 4 cameras x 25 pulses, 0 missing, 0 suspect");
  EXPECT_TRUE(reports(
      "lost: no frame for 3 pulses after pulse 9. It is reopened automatically; check its power, "
      "its cable and its trigger line with v3dctl doctor"));
  EXPECT_TRUE(reports("recording again, at pulse "));
}

/// 2 Hz. After the reopening, clock and arrival must agree within 0.4 periods
/// (capture/sync/pulse_matcher.cc): at 10 Hz that is 40 ms, too little on a busy machine.
class UnpluggedCamera : public FaultyStudio {
 protected:
  UnpluggedCamera() : FaultyStudio(fault(10, "unplug", "ms = 8000"), kSlow) {}
};
TEST_F(UnpluggedCamera, is_reported_and_rejoins_the_take_at_the_pulse_of_its_clock) {
  record_until_back(10, 5);
  EXPECT_TRUE(reports(
      "lost: no frame for 3 pulses after pulse 9. It is reopened automatically; check its power, "
      "its cable and its trigger line with v3dctl doctor"));
  EXPECT_TRUE(reports("check its power, its cable"));
  EXPECT_TRUE(reports("recording again, at pulse "));
  expect_one_gap_from(10, 15);
  EXPECT_THAT(faulty().duplicate, IsEmpty());
}

/// 2 Hz: a frame that a busy machine delays by half a period gets the number of the next pulse.
class CameraWithNewClock : public FaultyStudio {
 protected:
  CameraWithNewClock()
      : FaultyStudio(fault(kArrivalsKnown, "unplug", "ms = 5000\nnew_clock = true"), kSlow) {}
};
TEST_F(CameraWithNewClock,
       rejoins_the_take_with_suspect_frames_until_arrival_times_confirm_the_pulse) {
  record_until_back(kArrivalsKnown, 5);
  ASSERT_GE(faulty().missing.size(), 10U);
  EXPECT_EQ(faulty().missing,
            range(kArrivalsKnown, kArrivalsKnown - 1 + std::ssize(faulty().missing)))
      << "one gap";
  EXPECT_THAT(faulty().duplicate, IsEmpty());
  ASSERT_THAT(faulty().suspect, testing::Not(IsEmpty()));
  EXPECT_EQ(faulty().suspect.front(), faulty().missing.back() + 1);
  EXPECT_EQ(faulty().suspect, range(faulty().suspect.front(), faulty().suspect.back()));
  EXPECT_LT(faulty().suspect.back(), verified_.ledger.commanded - 1)
      << "later frames are not suspect";
}

/// 2 Hz, for the same reason.
class FrozenCamera : public FaultyStudio {
 protected:
  FrozenCamera() : FaultyStudio(fault(10, "freeze", "pulses = 6"), kSlow) {}
};
TEST_F(FrozenCamera, is_reported_and_continues_in_the_take) {
  run_until_back(10, 5);
  stop_and_check();
  EXPECT_THAT(faulty().missing, testing::IsSupersetOf(not_sent("cam02")));
  expect_one_gap_from(10, 6);
  EXPECT_TRUE(reports(
      "lost: no frame for 3 pulses after pulse 9. It is reopened automatically; check its power, "
      "its cable and its trigger line with v3dctl doctor"));
  EXPECT_TRUE(reports("recording again, at pulse "));
}

class CameraFrozenForLong : public FaultyStudio {
 protected:
  CameraFrozenForLong() : FaultyStudio(fault(10, "freeze", "pulses = 20")) {}
};
TEST_F(CameraFrozenForLong, is_reopened_and_continues_in_the_take) {
  run_until_back(10, 5);
  stop_and_check();
  EXPECT_THAT(faulty().missing, testing::IsSupersetOf(not_sent("cam02")));
  expect_one_gap_from(10, 20);
}

class BlackImage : public FaultyStudio {
 protected:
  BlackImage() : FaultyStudio(fault(10, "black")) {}
};
TEST_F(BlackImage, is_recorded_under_its_pulse_like_any_other) {
  record(kPulses);
  EXPECT_TRUE(verified_.whole()) << verdict();
  take::FrameLogReader frames(take().frames("cam02"));
  EXPECT_THAT(frames.read(10)->image.bytes, testing::Each(0));
  EXPECT_THAT(frames.read(11)->image.bytes, testing::Contains(testing::Ne(0)));
}

class ClockAhead : public FaultyStudio {
 protected:
  ClockAhead() : FaultyStudio(fault(kArrivalsKnown, "clock", "jump_ms = 1000"), kSlow) {}
};
TEST_F(ClockAhead, makes_one_frame_suspect_and_gives_no_frame_a_wrong_pulse) {
  record(kPulses);
  EXPECT_THAT(faulty().missing, IsEmpty());
  // A busy machine may deliver a frame late, which makes it suspect, too.
  EXPECT_THAT(faulty().suspect, AllOf(Contains(kArrivalsKnown),
                                      IsSubsetOf(range(kArrivalsKnown, kArrivalsKnown + 2))));
  EXPECT_EQ(check_.frames_mislabelled, 0) << testing::PrintToString(check_.problems);
}

/// By more than ten periods: after a smaller step back, the frames may as well be late.
class ClockBehind : public FaultyStudio {
 protected:
  ClockBehind() : FaultyStudio(fault(kArrivalsKnown, "clock", "jump_ms = -6000"), kSlow) {}
};
TEST_F(ClockBehind, makes_one_frame_suspect_and_gives_no_frame_a_wrong_pulse) {
  record(kPulses);
  EXPECT_THAT(faulty().missing, IsEmpty());
  // A busy machine may deliver a frame late, which makes it suspect, too.
  EXPECT_THAT(faulty().suspect, AllOf(Contains(kArrivalsKnown),
                                      IsSubsetOf(range(kArrivalsKnown, kArrivalsKnown + 2))));
  EXPECT_EQ(check_.frames_mislabelled, 0) << testing::PrintToString(check_.problems);
}

class DriftingClock : public FaultyStudio {
 protected:
  DriftingClock() : FaultyStudio(fault(5, "clock", "drift_ppm = 150")) {}
};
TEST_F(DriftingClock, is_followed) {
  record(kPulses);
  EXPECT_TRUE(verified_.whole()) << verdict();
}

}  // namespace
}  // namespace v3d
