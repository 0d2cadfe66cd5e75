// Scenario tests of the disk of the takes: small, full, read-only, removed, slow, with write
// errors.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <nlohmann/json.hpp>

#include "daemon/bus/bus.h"
#include "studio4.h"
#include "support/small_disk.h"
#include "support/temporary_folder.h"
#include "take/ledger/verify.h"
#include "take/logs/log_files.h"
#include "wire/messages.h"

namespace v3d {
namespace {

using test::becomes_true;
using test::Studio4;
using test::within;
using testing::HasSubstr;
using testing::IsEmpty;

constexpr int64_t kPulseBytes = 4 * 320 * 240;

/// Takes are written to a tmpfs of 48 MB.
class SmallDiskStudio4 : public Studio4 {
 protected:
  SmallDiskStudio4() : Studio4({.rate = "10", .takes = "takes"}) {
    if (!disk_.is_mounted()) throw std::runtime_error("cannot mount a tmpfs here");
  }
  const test::SmallDisk disk_{folder_ / "takes", 48'000'000};
};

TEST_F(SmallDiskStudio4, rejects_arming_when_the_disk_has_too_little_space) {
  EXPECT_THAT(command(wire::CommandVerb::kArm).replies.at("cap01").text,
              HasSubstr("needs 922 MB for 5 min, 48 MB free (room for"));
  EXPECT_THAT(command(wire::CommandVerb::kArm, 200).replies.at("cap01").text,
              HasSubstr("needs 61.4 MB for 200 pulses, 48 MB free"));
  ASSERT_TRUE(command(wire::CommandVerb::kAbort).done());
  disk_.become_read_only();
  EXPECT_THAT(command(wire::CommandVerb::kArm, 20).replies.at("cap01").text,
              HasSubstr("Read-only file system"));
}

TEST_F(SmallDiskStudio4, reports_a_read_only_disk_before_a_take_is_armed) {
  bus::Bus bus(studio_.network.lcm_url);
  bus::Subscription<wire::EventMessage> events(bus, wire::kEventChannel, 256);
  disk_.become_read_only();
  const auto is_reported = [&] {
    while (const auto event = events.wait(Monotonic::now())) {
      if (event->subject == "disk" && event->severity == wire::Severity::kAlarm) {
        EXPECT_THAT(event->text, HasSubstr("Read-only file system"));
        return true;
      }
    }
    return false;
  };
  EXPECT_TRUE(becomes_true(is_reported, within(60))) << log();
}

TEST_F(SmallDiskStudio4, ends_the_take_cleanly_before_the_disk_is_full) {
  bus::Bus bus(studio_.network.lcm_url);
  bus::Subscription<wire::EventMessage> events(bus, wire::kEventChannel, 256);
  const control::Answer armed = command(wire::CommandVerb::kArm, 100);
  ASSERT_TRUE(armed.done()) << text_of(armed) << log();
  disk_.leave((32 + 10) * kPulseBytes);  // the queue and one second of recording
  ASSERT_TRUE(command(wire::CommandVerb::kStart).done()) << log();
  std::string event_text;
  const auto ended = [&] {
    while (const auto event = events.wait(Monotonic::now())) {
      if (event->subject == "take") event_text = event->text;
    }
    return !event_text.empty();
  };
  ASSERT_TRUE(becomes_true(ended, within(30))) << log();
  EXPECT_THAT(event_text, HasSubstr("kendo-07 was stopped: ")) << event_text;
  EXPECT_THAT(event_text, HasSubstr("is nearly full: ")) << event_text;

  const control::Answer stopped = command(wire::CommandVerb::kStop);
  ASSERT_TRUE(stopped.done()) << text_of(stopped) << log();
  const auto ledger = nlohmann::json::parse(stopped.replies.at("cap01").detail);
  EXPECT_TRUE(ledger["complete"]) << ledger;
  EXPECT_LT(ledger["pulses"]["commanded"], 60) << ledger;
  const take::Verification verified = verify_take(take());
  EXPECT_TRUE(verified.whole()) << verified.ledger.verdict() << log();
  EXPECT_FALSE(std::filesystem::exists(take().reserve()));
}

TEST_F(SmallDiskStudio4, reports_a_lost_disk_at_once_and_fails_to_write_the_ledger) {
  bus::Bus bus(studio_.network.lcm_url);
  bus::Subscription<wire::EventMessage> events(bus, wire::kEventChannel, 256);
  arm_and_start(100);
  disk_.vanish();
  const auto is_reported = [&] {
    while (const auto event = events.wait(Monotonic::now())) {
      if (event->text.find("is the disk of ") != std::string::npos) return true;
    }
    return false;
  };
  EXPECT_TRUE(becomes_true(is_reported, within(30))) << log();
  const control::Answer stopped = command(wire::CommandVerb::kStop);
  EXPECT_THAT(stopped.replies.at("cap01").text, HasSubstr("cannot write the ledger"));
  EXPECT_THAT(stopped.replies.at("cap01").detail, HasSubstr("commanded"))
      << "the reply holds the ledger";
}

/// Sets the environment that preloads v3d_bad_disk into daemons started during its lifetime.
struct BadDiskPreloaded {
  BadDiskPreloaded() {
    setenv("LD_PRELOAD", V3D_BAD_DISK_LIBRARY, 1);
    setenv("V3D_BAD_DISK", control().c_str(), 1);
  }
  ~BadDiskPreloaded() {
    unsetenv("LD_PRELOAD");
    unsetenv("V3D_BAD_DISK");
  }
  std::filesystem::path control() const { return folder_ / "disk-fault"; }

 private:
  const test::TemporaryFolder folder_;
};

/// A studio whose disk a test can make faulty (support/bad_disk.cc).
class BadDiskStudio4 : private BadDiskPreloaded, public Studio4 {
 protected:
  BadDiskStudio4() : Studio4({.rate = "10"}) {}

  void set_disk_fault(const std::string& fault) { test::write_text(control(), fault); }
  /// Each write takes 250 ms, longer than a period of the trigger (100 ms).
  void set_disk_slow() { set_disk_fault("slow 250"); }
  void recover() { std::filesystem::remove(control()); }

  /// Every commanded pulse was received, and every received frame is written or listed as missing.
  /// Pulses that the trigger skipped on a busy machine (unsensed) are left out.
  void expect_every_frame_accounted_for(const take::Verification& verified) const {
    const auto unsensed = std::ssize(take::load_ledger(take().ledger()).unsensed);
    for (const take::CameraLedger& camera : verified.ledger.cameras) {
      EXPECT_GE(camera.written, 10) << camera.name;
      EXPECT_EQ(camera.received, verified.ledger.commanded - unsensed) << camera.name;
      EXPECT_EQ(camera.received - camera.written, std::ssize(camera.missing) - unsensed)
          << camera.name;
    }
  }

  /// Waits up to 60 s for an event about `subject`. False at timeout.
  bool receives_event(bus::Subscription<wire::EventMessage>& events, const std::string& subject,
                      wire::Severity severity = wire::Severity::kAlarm) {
    const auto is_received = [&] {
      while (const auto event = events.wait(Monotonic::now())) {
        if (event->subject == subject && event->severity == severity) return true;
      }
      return false;
    };
    return becomes_true(is_received, within(60));
  }
};

TEST_F(BadDiskStudio4, reports_a_slow_disk_before_the_first_frame_is_lost) {
  bus::Bus bus(studio_.network.lcm_url);
  bus::Subscription<wire::EventMessage> events(bus, wire::kEventChannel, 256);
  arm_and_start(0);
  set_disk_slow();
  ASSERT_TRUE(receives_event(events, "queue")) << log();
  recover();
  const control::Answer stopped = command(wire::CommandVerb::kStop);
  ASSERT_TRUE(stopped.done()) << text_of(stopped) << log();
  EXPECT_TRUE(nlohmann::json::parse(stopped.replies.at("cap01").detail)["complete"]) << log();
}

TEST_F(BadDiskStudio4, drops_the_oldest_frames_of_a_full_queue_and_reports_each) {
  bus::Bus bus(studio_.network.lcm_url);
  bus::Subscription<wire::EventMessage> events(bus, wire::kEventChannel, 256);
  arm_and_start(0);
  set_disk_slow();
  ASSERT_TRUE(reaches("cap01", "cam01.frames_dropped", 1)) << log();
  EXPECT_TRUE(receives_event(events, "queue"));
  EXPECT_TRUE(receives_event(events, "disk"));
  recover();
  const control::Answer stopped = command(wire::CommandVerb::kStop);
  ASSERT_TRUE(stopped.done()) << text_of(stopped) << log();
  const take::Verification verified = verify_take(take());
  EXPECT_THAT(verified.disagreements, IsEmpty());
  expect_every_frame_accounted_for(verified);
  EXPECT_GT(verified.ledger.cameras[0].missing.size(), 0U);
}

TEST_F(BadDiskStudio4, ends_the_take_on_a_write_error_and_accounts_for_every_frame) {
  bus::Bus bus(studio_.network.lcm_url);
  bus::Subscription<wire::EventMessage> events(bus, wire::kEventChannel, 256);
  arm_and_start(0);
  ASSERT_TRUE(reaches("cap01", "frames_written", 40)) << log();
  // The first lost frame ends the take, so pulses are lost before it. The count in the health may
  // be a second old, which is 10 pulses.
  set_disk_fault("pulses");
  ASSERT_TRUE(reaches("cap01", "pulses_sensed", value("cap01", "pulses_sensed") + 20)) << log();
  set_disk_fault("broken");
  ASSERT_TRUE(receives_event(events, "take")) << log();
  EXPECT_TRUE(receives_event(events, "pulses", wire::Severity::kWarning))
      << "pulses that the log lacks" << log();
  ASSERT_TRUE(becomes_idle()) << log();
  recover();
  const control::Answer stopped = command(wire::CommandVerb::kStop);
  ASSERT_TRUE(stopped.done()) << text_of(stopped) << log();
  const take::Verification verified = verify_take(take());
  EXPECT_THAT(verified.disagreements, testing::ElementsAre(HasSubstr("pulses.lcmlog: holds ")))
      << "the ledger also counts pulses that could not be written";
  EXPECT_EQ(verified.info.state, take::TakeState::kComplete);
  EXPECT_FALSE(verified.ledger.complete());
  expect_every_frame_accounted_for(verified);
}

TEST_F(BadDiskStudio4, closes_a_take_on_a_full_disk_with_an_index_of_each_log_with_a_cut_frame) {
  arm_and_start(0);
  ASSERT_TRUE(reaches("cap01", "frames_written", 40)) << log();
  set_disk_fault("full");
  ASSERT_TRUE(becomes_idle()) << log();
  for (const std::string camera : {"cam01", "cam02", "cam03", "cam04"}) {
    const std::filesystem::path frames = take().frames(camera);
    const auto index = take::load_segment_index(frames, std::filesystem::file_size(frames));
    ASSERT_TRUE(index) << index.error().message;
    ASSERT_TRUE(*index) << camera << ": its index needs the reserved space" << log();
    EXPECT_EQ((*index)->bytes, (*index)->whole_bytes + 100) << camera;
    EXPECT_GT((*index)->events, 0) << camera;
  }
  recover();
  EXPECT_THAT(verify_take(take()).disagreements, IsEmpty());
}

TEST_F(BadDiskStudio4, ends_a_take_that_cannot_be_synced_and_does_not_report_it_as_complete) {
  bus::Bus bus(studio_.network.lcm_url);
  bus::Subscription<wire::EventMessage> events(bus, wire::kEventChannel, 256);
  arm_and_start(0);
  ASSERT_TRUE(reaches("cap01", "frames_written", 40)) << log();
  set_disk_fault("forgets");
  std::string text;
  const auto stays_open = [&] {
    while (const auto event = events.wait(Monotonic::now())) {
      if (event->text.find("stays open") != std::string::npos) text = event->text;
    }
    return !text.empty();
  };
  ASSERT_TRUE(becomes_true(stays_open, within(60))) << log();
  EXPECT_THAT(text, HasSubstr("cannot write the last frames of cam01, cam02, cam03, cam04: "));
  EXPECT_THAT(text, HasSubstr("Input/output error"));
  const control::Answer stopped = command(wire::CommandVerb::kStop);
  EXPECT_THAT(stopped.replies.at("cap01").text, HasSubstr("kendo-07 stays open: ")) << log();
  EXPECT_EQ(load_take_info(take()).state, take::TakeState::kRecording)
      << "the next start counts it";
}

}  // namespace
}  // namespace v3d
