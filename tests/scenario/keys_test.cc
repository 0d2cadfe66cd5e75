// Keys that are replaced while the studio records.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "daemon/bus.h"
#include "studio4.h"
#include "take/verify.h"
#include "wire/channels.h"

namespace v3d {
namespace {

using test::becomes_true;
using test::Studio4;
using test::within;

TEST_F(Studio4, replaces_its_key_while_it_records_and_loses_no_frame) {
  arm_and_start(0);
  ASSERT_TRUE(reaches("cap01", "frames_written", 40)) << log();
  const StudioKey next = StudioKey::make();
  next.save(folder_ / "next.key");
  std::filesystem::rename(folder_ / "next.key", studio_.network.key);

  // Holders of the new key alone receive what all nodes send, and the nodes receive each other.
  Bus renewed(studio_.network.lcm_url, {}, ChannelList(studio_));
  renewed.seal().set_key(next);
  Subscription<HealthMessage> captured(renewed, health_channel("cap01"), 16);
  Subscription<HealthMessage> recond(renewed, health_channel("recon01"), 16);
  ASSERT_TRUE(captured.wait(within(60))) << log();
  ASSERT_TRUE(recond.wait(within(60))) << log();
  ASSERT_TRUE(reaches("cap01", "frames_written", value("cap01", "frames_written") + 40)) << log();
  ASSERT_TRUE(reaches("recon01", "meshes", value("recon01", "meshes") + 5)) << log();
  EXPECT_EQ(value("recon01", "frames_lost"), 0);
  for (const char* node : {"cap01", "recon01"})
    EXPECT_EQ(value(node, "messages_forged"), 0) << node;

  OperatorClient newcomer(studio_);
  CommandMessage stop;
  stop.verb = CommandVerb::kStop;
  const Answer stopped = newcomer.command(stop, within(60));
  ASSERT_TRUE(stopped.done()) << text_of(stopped) << log();
  EXPECT_TRUE(verify_take(take()).whole()) << verify_take(take()).ledger.verdict();
  EXPECT_THAT(log(), testing::HasSubstr("a new studio key"));
}

}  // namespace
}  // namespace v3d
