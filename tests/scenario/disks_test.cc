// Stories of the disk that takes are written to: small, full, read-only, gone, slow.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <nlohmann/json.hpp>

#include "daemon/bus/bus.h"
#include "studio4.h"
#include "support/small_disk.h"
#include "support/temporary_folder.h"
#include "take/ledger/verify.h"
#include "wire/channels.h"

namespace v3d {
namespace {

using test::becomes_true;
using test::Studio4;
using test::within;
using testing::HasSubstr;
using testing::IsEmpty;

constexpr int64_t kPulseBytes = 4 * 320 * 240;

/// Takes are written to a disk of their own, of 48 MB.
class SmallDiskStudio4 : public Studio4 {
 protected:
  SmallDiskStudio4() : Studio4({.takes = "takes"}) {
    if (!disk_.is_mounted()) throw std::runtime_error("cannot mount a tmpfs here");
  }
  const test::SmallDisk disk_{folder_ / "takes", 48'000'000};
};

TEST_F(SmallDiskStudio4, rejects_arming_when_the_disk_has_too_little_space) {
  EXPECT_THAT(command(CommandVerb::kArm).replies.at("cap01").text,
              HasSubstr("needs 1.84 GB for 5 min, 48 MB free (room for"));
  EXPECT_THAT(command(CommandVerb::kArm, 200).replies.at("cap01").text,
              HasSubstr("needs 61.4 MB for 200 pulses, 48 MB free"));
  ASSERT_TRUE(command(CommandVerb::kAbort).done());
  disk_.become_read_only();
  EXPECT_THAT(command(CommandVerb::kArm, 20).replies.at("cap01").text,
              HasSubstr("Read-only file system"));
}

TEST_F(SmallDiskStudio4, ends_the_take_cleanly_before_the_disk_is_full) {
  Bus bus(studio_.network.lcm_url);
  Subscription<EventMessage> events(bus, kEventChannel, 256);
  const Answer armed = command(CommandVerb::kArm, 100);
  ASSERT_TRUE(armed.done()) << text_of(armed) << log();
  disk_.leave((32 + 20) * kPulseBytes);  // the queue, and a second of recording
  ASSERT_TRUE(command(CommandVerb::kStart).done()) << log();
  std::string told;
  const auto ended = [&] {
    while (const auto event = events.wait(Monotonic::now())) {
      if (event->subject == "take") told = event->text;
    }
    return !told.empty();
  };
  ASSERT_TRUE(becomes_true(ended, within(30))) << log();
  EXPECT_THAT(told, HasSubstr("kendo-07 was stopped: ")) << told;
  EXPECT_THAT(told, HasSubstr("is nearly full: ")) << told;

  const Answer stopped = command(CommandVerb::kStop);
  ASSERT_TRUE(stopped.done()) << text_of(stopped) << log();
  const auto ledger = nlohmann::json::parse(stopped.replies.at("cap01").detail);
  EXPECT_TRUE(ledger["complete"]) << ledger;
  EXPECT_LT(ledger["pulses"]["commanded"], 60) << ledger;
  const Verification verified = verify_take(take());
  EXPECT_TRUE(verified.whole()) << verified.ledger.verdict() << log();
  EXPECT_FALSE(std::filesystem::exists(take().reserve()));
}

TEST_F(SmallDiskStudio4, reports_a_lost_disk_at_once_and_fails_to_write_the_ledger) {
  Bus bus(studio_.network.lcm_url);
  Subscription<EventMessage> events(bus, kEventChannel, 256);
  arm_and_start(100);
  disk_.vanish();
  const auto told = [&] {
    while (const auto event = events.wait(Monotonic::now())) {
      if (event->text.find("is the disk of ") != std::string::npos) return true;
    }
    return false;
  };
  EXPECT_TRUE(becomes_true(told, within(30))) << log();
  const Answer stopped = command(CommandVerb::kStop);
  EXPECT_THAT(stopped.replies.at("cap01").text, HasSubstr("cannot write the ledger"));
  EXPECT_THAT(stopped.replies.at("cap01").detail, HasSubstr("commanded")) << "the account is told";
}

/// The environment of the daemons that are started while it lives.
struct BadDiskPreloaded {
  BadDiskPreloaded() {
    setenv("LD_PRELOAD", V3D_BAD_DISK_LIBRARY, 1);
    setenv("V3D_BAD_DISK", control().c_str(), 1);
  }
  ~BadDiskPreloaded() {
    unsetenv("LD_PRELOAD");
    unsetenv("V3D_BAD_DISK");
  }
  std::filesystem::path control() const { return folder_ / "illness"; }

 private:
  const test::TemporaryFolder folder_;
};

/// A disk that a test can make bad (support/bad_disk.cc).
class BadDiskStudio4 : private BadDiskPreloaded, public Studio4 {
 protected:
  void become(const std::string& illness) { test::write_text(control(), illness); }
  /// Each write takes longer than a period of the trigger (50 ms).
  void become_slow() { become("slow 70"); }
  void recover() { std::filesystem::remove(control()); }

  /// Received by number, written or missing by name. A trigger whose host hesitates leaves pulses
  /// out.
  void expect_every_frame_accounted_for(const Verification& verified) const {
    const auto left_out = std::ssize(load_ledger(take().ledger()).unsensed);
    for (const CameraLedger& camera : verified.ledger.cameras) {
      EXPECT_GE(camera.written, 10) << camera.name;
      EXPECT_EQ(camera.received, verified.ledger.commanded - left_out) << camera.name;
      EXPECT_EQ(camera.received - camera.written, std::ssize(camera.missing) - left_out)
          << camera.name;
    }
  }

  /// Waits for an event about `subject`.
  bool hear(Subscription<EventMessage>& events, const std::string& subject,
            Severity severity = Severity::kAlarm) {
    const auto heard = [&] {
      while (const auto event = events.wait(Monotonic::now())) {
        if (event->subject == subject && event->severity == severity) return true;
      }
      return false;
    };
    return becomes_true(heard, within(60));
  }
};

TEST_F(BadDiskStudio4, reports_a_slow_disk_before_the_first_frame_is_lost) {
  Bus bus(studio_.network.lcm_url);
  Subscription<EventMessage> events(bus, kEventChannel, 256);
  arm_and_start(0);
  become_slow();
  ASSERT_TRUE(hear(events, "queue")) << log();
  recover();
  const Answer stopped = command(CommandVerb::kStop);
  ASSERT_TRUE(stopped.done()) << text_of(stopped) << log();
  EXPECT_TRUE(nlohmann::json::parse(stopped.replies.at("cap01").detail)["complete"]) << log();
}

TEST_F(BadDiskStudio4, drops_the_oldest_frames_of_a_full_queue_and_reports_each) {
  Bus bus(studio_.network.lcm_url);
  Subscription<EventMessage> events(bus, kEventChannel, 256);
  arm_and_start(0);
  become_slow();
  ASSERT_TRUE(reaches("cap01", "cam01.frames_dropped", 1)) << log();
  EXPECT_TRUE(hear(events, "queue"));
  EXPECT_TRUE(hear(events, "disk"));
  recover();
  const Answer stopped = command(CommandVerb::kStop);
  ASSERT_TRUE(stopped.done()) << text_of(stopped) << log();
  const Verification verified = verify_take(take());
  EXPECT_THAT(verified.disagreements, IsEmpty());
  expect_every_frame_accounted_for(verified);
  EXPECT_GT(verified.ledger.cameras[0].missing.size(), 0U);
}

TEST_F(BadDiskStudio4, ends_the_take_on_a_write_error_and_accounts_for_every_frame) {
  Bus bus(studio_.network.lcm_url);
  Subscription<EventMessage> events(bus, kEventChannel, 256);
  arm_and_start(0);
  ASSERT_TRUE(reaches("cap01", "frames_written", 40)) << log();
  become("broken");
  ASSERT_TRUE(hear(events, "take")) << log();
  EXPECT_TRUE(hear(events, "pulses", Severity::kWarning)) << "of those the log lacks" << log();
  ASSERT_TRUE(becomes_idle()) << log();
  recover();
  const Answer stopped = command(CommandVerb::kStop);
  ASSERT_TRUE(stopped.done()) << text_of(stopped) << log();
  const Verification verified = verify_take(take());
  EXPECT_THAT(verified.disagreements, testing::Each(HasSubstr("pulses.lcmlog: holds ")))
      << "the ledger knows of pulses, too, that the disk refused";
  EXPECT_EQ(verified.info.state, TakeState::kComplete);
  EXPECT_FALSE(verified.ledger.complete());
  expect_every_frame_accounted_for(verified);
}

TEST_F(BadDiskStudio4, does_not_report_a_take_as_complete_after_a_failed_fsync) {
  arm_and_start(20);
  become("forgets");
  ASSERT_TRUE(reaches("cap01", "pulses_sensed", 20)) << log();
  const Answer stopped = command(CommandVerb::kStop);
  EXPECT_THAT(stopped.replies.at("cap01").text,
              HasSubstr("cannot write the last frames of cam01, cam02, cam03, cam04"));
}

}  // namespace
}  // namespace v3d
