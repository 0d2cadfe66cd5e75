// The sound of a take while the disk does not answer.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "daemon/captured/node_sound.h"
#include "sound/wave_file.h"
#include "support/child_process.h"
#include "support/held_writes.h"
#include "support/temporary_folder.h"

namespace v3d::captured {
namespace {

using testing::ElementsAre;

constexpr int kRate = 48'000;
constexpr int64_t kBlock = 480;

StudioSound one_channel() {
  return {.node = "cap01", .device = "simulated:", .channels = 1, .timecode_rate = {}};
}

/// Block `number` of a device; each value is the number of its block.
sound::SoundBlock block(int64_t number) {
  const int64_t end = (number + 1) * kBlock;
  return {.position = number * kBlock,
          .xruns = 0,
          .at = from_ns<Monotonic>(1'000'000'000 * (5 * kRate + end) / kRate),
          .values = std::vector<int32_t>(kBlock, static_cast<int32_t>(number << 8))};
}

class SlowDisk : public testing::Test {
 protected:
  const test::TemporaryFolder folder_;
  const take::TakePaths take_{folder_ / "kendo-07"};
};

TEST_F(SlowDisk, loses_the_oldest_blocks_and_keeps_the_position_of_those_after_them) {
  test::HeldWrites held;
  const auto queue = std::make_shared<SoundQueue>(100);
  SoundTake take({.sound = one_channel(), .paths = take_, .take = "kendo-07"}, queue);
  queue->push(block(0));
  ASSERT_TRUE(held.wait_for_write()) << "the thread creates the file";
  for (int64_t number = 1; number <= 150; ++number) queue->push(block(number));
  held.release();
  const auto ledger = take.close();
  ASSERT_TRUE(ledger);
  EXPECT_EQ(ledger->samples, 151 * kBlock);
  EXPECT_EQ(ledger->xruns, 1);
  EXPECT_EQ(ledger->lost_samples, 50 * kBlock);
  EXPECT_THAT(ledger->gaps, ElementsAre(ElementsAre(480.0, 24'000.0)));
  auto wave = sound::WaveReader::open(take_.folder / ledger->file);
  ASSERT_TRUE(wave) << wave.error().message;
  ASSERT_EQ(wave->samples(), 151 * kBlock);
  for (const auto& [number, value] : {std::pair(0, 0), std::pair(1, 0), std::pair(50, 0),
                                      std::pair(51, 51), std::pair(150, 150)}) {
    EXPECT_THAT(wave->read(number * kBlock, 1).value(), ElementsAre(value << 8)) << number;
  }
}

TEST_F(SlowDisk, is_noticed_by_the_sound_that_waits_for_it) {
  test::HeldWrites held;
  NodeSound sound(one_channel(), {});
  sound.begin(take_, "kendo-07", 25);
  EXPECT_TRUE(test::becomes_true([&] { return sound.status().waiting_s > 0.5; }, test::within(60)));
  held.release();
  EXPECT_TRUE(test::becomes_true([&] { return sound.status().waiting_s < 0.2; }, test::within(60)));
  const auto ledger = sound.end();
  ASSERT_TRUE(ledger);
  EXPECT_EQ(ledger->xruns, 0) << "ten seconds fit into the queue";
  EXPECT_EQ(sound.status().waiting_s, 0);
}

}  // namespace
}  // namespace v3d::captured
