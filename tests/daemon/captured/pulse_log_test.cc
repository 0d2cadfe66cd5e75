#include <gtest/gtest.h>

#include <cerrno>

#include "daemon/captured/pulse_recorder.h"
#include "support/fsync_hook.h"
#include "support/temporary_folder.h"

namespace v3d::captured {
namespace {

TEST(PulseLogSync, includes_the_last_pulses_before_a_pause) {
  const test::TemporaryFolder folder;
  test::FsyncHook hook;
  PulseLog log(folder / "pulses.lcmlog", take::LogOpening::kNew);
  wire::PulseMessage pulse;
  log.write(pulse);
  ASSERT_TRUE(hook.wait_for(1));
  pulse.pulse = 1;
  log.write(pulse);
  ASSERT_TRUE(hook.wait_for(2)) << "no later pulse follows";
  log.close();
  EXPECT_EQ(take::read_pulses(folder / "pulses.lcmlog").size(), 2U);
}

TEST(PulseLogSync, fails_when_only_the_sync_of_its_close_fails) {
  const test::TemporaryFolder folder;
  test::FsyncHook hook;
  PulseLog log(folder / "pulses.lcmlog", take::LogOpening::kNew);
  log.write(wire::PulseMessage());
  ASSERT_TRUE(hook.wait_for(1));
  hook.fail_next(EIO);
  log.close();
  ASSERT_FALSE(log.synced());
  EXPECT_EQ(log.synced().error().code, EIO);
}

TEST(KnownPulses, accept_pulses_after_minutes_without_messages_while_pulses_ran) {
  const MonotonicInstant start = from_ns<Monotonic>(1'000'000'000);
  KnownPulses known("kendo-07", start);
  wire::PulseMessage pulse;
  pulse.take = "kendo-07";
  pulse.pulse = 20'000;
  EXPECT_FALSE(known.accepts(pulse, start));
  EXPECT_TRUE(known.accepts(pulse, start + std::chrono::seconds(160)));
  known.add(pulse.pulse, start + std::chrono::seconds(160));
  EXPECT_FALSE(known.accepts(pulse, start + std::chrono::seconds(160))) << "a repeated message";
}

}  // namespace
}  // namespace v3d::captured
