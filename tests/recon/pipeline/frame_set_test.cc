#include "recon/pipeline/frame_set.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <set>

namespace v3d::recon {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;
using namespace std::chrono_literals;

MonotonicInstant at(Duration since_start) { return MonotonicInstant(1000s + since_start); }

Frame frame(const std::string& camera, int64_t pulse, uint64_t counter = 0) {
  Frame f;
  f.camera = camera;
  f.label.pulse = pulse;
  f.label.camera_counter = counter;
  return f;
}

FrameSetAssembler assembler(int max_open = 16) {
  return FrameSetAssembler({.cameras = {"b", "a", "c"}, .deadline = 100ms, .max_open = max_open});
}

std::vector<std::string> cameras_of(const FrameSet& set) {
  std::vector<std::string> names;
  for (const Frame& f : set.frames) {
    names.push_back(f.camera);
  }
  return names;
}

TEST(FrameSets, are_complete_when_every_camera_has_delivered) {
  auto sets = assembler();
  EXPECT_THAT(sets.add(frame("c", 0), at(0ms)), IsEmpty());
  EXPECT_THAT(sets.add(frame("a", 0), at(1ms)), IsEmpty());
  const auto ready = sets.add(frame("b", 0), at(2ms));
  ASSERT_EQ(ready.size(), 1U);
  EXPECT_EQ(ready[0].set.pulse, 0);
  EXPECT_THAT(cameras_of(ready[0].set), ElementsAre("a", "b", "c"));
  EXPECT_THAT(ready[0].missing, IsEmpty());
  EXPECT_EQ(sets.counters().complete, 1);
  EXPECT_FALSE(sets.next_deadline());
}

TEST(FrameSets, omit_a_late_camera_at_their_deadline_and_name_it) {
  auto sets = assembler();
  sets.add(frame("a", 5), at(0ms));
  sets.add(frame("c", 5), at(50ms));
  EXPECT_EQ(sets.next_deadline(), at(100ms));  // from the first frame, not the last
  EXPECT_THAT(sets.poll(at(100ms) - 1ns), IsEmpty());
  const auto ready = sets.poll(at(100ms));
  ASSERT_EQ(ready.size(), 1U);
  EXPECT_THAT(cameras_of(ready[0].set), ElementsAre("a", "c"));
  EXPECT_THAT(ready[0].missing, ElementsAre("b"));
  EXPECT_THAT(sets.add(frame("b", 5), at(101ms)), IsEmpty());
  EXPECT_EQ(sets.counters(), (FrameSetCounters{.incomplete = 1, .late = 1}));
}

TEST(FrameSets, that_are_complete_wait_for_older_ones_to_keep_the_order_of_pulses) {
  auto sets = assembler();
  sets.add(frame("a", 0), at(0ms));
  for (const char* camera : {"a", "b", "c"}) {
    EXPECT_THAT(sets.add(frame(camera, 1), at(40ms)), IsEmpty());
  }
  const auto ready = sets.poll(at(100ms));
  ASSERT_EQ(ready.size(), 2U);
  EXPECT_EQ(ready[0].set.pulse, 0);
  EXPECT_THAT(ready[0].missing, ElementsAre("b", "c"));
  EXPECT_EQ(ready[1].set.pulse, 1);
  EXPECT_THAT(ready[1].missing, IsEmpty());
}

TEST(FrameSets, skip_a_pulse_without_frames) {
  auto sets = assembler();
  for (const int64_t pulse : {0, 3}) {
    sets.add(frame("a", pulse), at(0ms));
    sets.add(frame("b", pulse), at(0ms));
    EXPECT_EQ(sets.add(frame("c", pulse), at(0ms)).size(), 1U);
  }
}

TEST(FrameSets, keep_the_first_of_two_frames_and_count_the_second) {
  auto sets = assembler();
  sets.add(frame("a", 0, 1), at(0ms));
  sets.add(frame("a", 0, 2), at(1ms));
  const auto ready = sets.flush();
  ASSERT_EQ(ready.size(), 1U);
  ASSERT_EQ(ready[0].set.frames.size(), 1U);
  EXPECT_EQ(ready[0].set.frames[0].label.camera_counter, 1U);
  EXPECT_EQ(sets.counters().duplicate, 1);
}

TEST(FrameSets, count_and_ignore_unknown_cameras_and_invalid_pulses) {
  auto sets = assembler();
  sets.add(frame("stranger", 0), at(0ms));
  sets.add(frame("a", -1), at(0ms));
  sets.add(frame("a", 7), at(0ms));
  sets.add(frame("a", 7 + 15'001), at(0ms));
  sets.add(frame("b", std::numeric_limits<int64_t>::max()), at(0ms));
  EXPECT_EQ(sets.counters(), (FrameSetCounters{.unknown = 1, .implausible = 3}));
  EXPECT_EQ(sets.flush().size(), 1U);
}

TEST(FrameSets, continue_after_minutes_without_frames_while_pulses_ran) {
  auto sets = assembler();
  sets.add(frame("a", 7), at(0s));
  sets.add(frame("a", 7 + 160'000), at(160s));  // 1000 pulses a second
  EXPECT_EQ(sets.counters().implausible, 0);
  EXPECT_EQ(sets.flush().back().set.pulse, 7 + 160'000);
}

TEST(FrameSets, that_wait_are_bounded_and_the_oldest_goes_first) {
  auto sets = assembler(3);
  std::vector<int64_t> sent;
  for (int64_t pulse = 0; pulse < 10; ++pulse) {
    for (const ReadySet& ready : sets.add(frame("a", pulse), at(0ms))) {
      sent.push_back(ready.set.pulse);
    }
  }
  EXPECT_THAT(sent, ElementsAre(0, 1, 2, 3, 4, 5, 6));
  EXPECT_EQ(sets.flush().size(), 3U);
}

TEST(FrameSets, restart_with_the_next_take) {
  auto sets = assembler();
  sets.add(frame("a", 40), at(0ms));
  sets.flush();
  sets.add(frame("a", 41), at(1ms));
  sets.restart();
  EXPECT_THAT(sets.flush(), IsEmpty());
  sets.add(frame("a", 0), at(2ms));
  EXPECT_EQ(sets.flush().size(), 1U);
  EXPECT_EQ(sets.counters().late, 0);
}

TEST(FrameSets, expect_a_camera_that_is_named_twice_once) {
  FrameSetAssembler sets({.cameras = {"a", "a"}});
  EXPECT_EQ(sets.add(frame("a", 0), at(0ms)).size(), 1U);
}

RC_GTEST_PROP(FrameSets, account_for_every_frame_and_never_go_back, ()) {
  auto sets = assembler(4);
  Duration now = 0ms;
  int64_t added = 0, out = 0, last = -1;
  const auto take = [&](const std::vector<ReadySet>& ready) {
    for (const ReadySet& r : ready) {
      RC_ASSERT(r.set.pulse > last);
      RC_ASSERT(r.set.frames.size() + r.missing.size() == 3U);
      RC_ASSERT(!r.set.frames.empty());
      for (const Frame& f : r.set.frames) {
        RC_ASSERT(f.label.pulse == r.set.pulse);
      }
      last = r.set.pulse;
      out += std::ssize(r.set.frames);
    }
  };
  const auto names = std::vector<std::string>{"a", "b", "c", "x"};
  for (const int step : *rc::gen::container<std::vector<int>>(rc::gen::inRange(0, 1 << 12))) {
    now += std::chrono::milliseconds(step % 40);
    take(sets.add(frame(names[(step >> 3) % 4], (step >> 5) % 16 - 1), at(now)));
    ++added;
  }
  take(sets.flush());
  const FrameSetCounters& c = sets.counters();
  RC_ASSERT(added == out + c.late + c.duplicate + c.unknown + c.implausible);
}

}  // namespace
}  // namespace v3d::recon
