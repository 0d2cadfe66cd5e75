#include "daemon/captured/pulse_log.h"

#include <gtest/gtest.h>

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

}  // namespace
}  // namespace v3d::captured
