// The live meshes that v3d-viewd sends to browsers, without sockets.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <chrono>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "codec/frame_header.h"
#include "daemon/viewd/dropped_meshes.h"
#include "daemon/viewd/web_streams.h"

namespace v3d::viewd {
namespace {

/// Frames with valid headers and without content.
class Meshes {
 public:
  wire::MeshMessage next(bool key) {
    codec::FrameHeader header;
    header.metadata.pulse = pulse_;
    header.metadata.step = 0.01;
    if (key) key_ = pulse_;
    header.key_pulse = key_;
    header.flags = codec::FrameHeader::kColours | (key ? 0 : codec::FrameHeader::kInter);
    header.colour_steps = {1, 1, 1};
    header.reference = key ? 0 : checksum_;
    wire::MeshMessage mesh;
    mesh.pulse = pulse_++;
    mesh.compact = write_frame(header, codec::Sections{{{1}, {1}, {}, {1}}});
    checksum_ = header.checksum;
    return mesh;
  }

 private:
  int64_t pulse_ = 0;
  int64_t key_ = 0;
  uint32_t checksum_ = 0;
};

constexpr MonotonicInstant kNow(std::chrono::hours(1));

/// The pulse in a message, -1 where there is none.
int64_t pulse_in(const std::optional<web::WebMessage>& message) {
  if (!message) return -1;
  const std::string key = "\"pulse\":";
  return std::stoll(message->bytes->substr(message->bytes->find(key) + key.size()));
}

TEST(LiveFeed, sends_every_frame_to_a_fast_subscriber) {
  LiveFeed feed;
  Meshes meshes;
  const auto subscriber = feed.subscribe(kNow);
  EXPECT_EQ(pulse_in(subscriber->next()), -1) << "no live mesh yet";
  for (int pulse = 0; pulse < 30; ++pulse) {
    feed.add(meshes.next(pulse % 10 == 0), kNow);
    EXPECT_EQ(pulse_in(subscriber->next()), pulse);
    EXPECT_EQ(pulse_in(subscriber->next()), -1);
  }
  EXPECT_EQ(feed.counts().skipped, 0);
}

TEST(LiveFeed, sends_a_slow_subscriber_the_newest_key_frame) {
  LiveFeed feed;
  Meshes meshes;
  const auto subscriber = feed.subscribe(kNow);
  feed.add(meshes.next(true), kNow);
  EXPECT_EQ(pulse_in(subscriber->next()), 0);
  for (int pulse = 1; pulse < 25; ++pulse) feed.add(meshes.next(pulse % 10 == 0), kNow);
  EXPECT_EQ(pulse_in(subscriber->next()), 20);
  EXPECT_EQ(pulse_in(subscriber->next()), 21);
  EXPECT_EQ(feed.counts().skipped, 19);
}

TEST(LiveFeed, drops_frames_that_are_not_after_the_last_pulse) {
  LiveFeed feed;
  Meshes meshes;
  const auto subscriber = feed.subscribe(kNow);
  const wire::MeshMessage first = meshes.next(true);
  wire::MeshMessage second = meshes.next(true);
  feed.add(first, kNow);
  feed.add(second, kNow);
  EXPECT_EQ(pulse_in(subscriber->next()), 1);
  feed.add(first, kNow);
  feed.add(second, kNow);
  EXPECT_EQ(pulse_in(subscriber->next()), -1);
  EXPECT_EQ(feed.counts().outdated, 2);
  wire::MeshMessage again = first;
  again.sent += std::chrono::minutes(1);
  feed.add(again, kNow);
  EXPECT_EQ(pulse_in(subscriber->next()), 0) << "a new take of the same name";
  second.take = "another";
  feed.add(second, kNow);
  EXPECT_EQ(pulse_in(subscriber->next()), 1);
}

TEST(LiveFeed, starts_a_late_subscriber_with_a_key_frame) {
  LiveFeed feed;
  Meshes meshes;
  for (int pulse = 0; pulse < 14; ++pulse) feed.add(meshes.next(pulse % 10 == 0), kNow);
  EXPECT_EQ(pulse_in(feed.subscribe(kNow)->next()), 10);
  EXPECT_EQ(feed.counts().skipped, 0) << "nothing was skipped";
}

TEST(LiveFeed, sends_no_frame_of_an_ended_take_to_a_new_subscriber) {
  LiveFeed feed;
  Meshes meshes;
  feed.add(meshes.next(true), kNow);
  feed.add(meshes.next(false), kNow);
  EXPECT_EQ(pulse_in(feed.subscribe(kNow + LiveFeed::kMaxAge)->next()), 0);
  const auto later = feed.subscribe(kNow + LiveFeed::kMaxAge + std::chrono::milliseconds(1));
  EXPECT_EQ(pulse_in(later->next()), -1);
  feed.add(meshes.next(false), kNow + std::chrono::seconds(20));
  for (int pulse = 0; pulse < 3; ++pulse) {
    EXPECT_EQ(pulse_in(later->next()), pulse) << "the mesh was only delayed, and needs its key";
  }
  const auto next_take = feed.subscribe(kNow + std::chrono::minutes(1));
  EXPECT_EQ(pulse_in(next_take->next()), -1);
  feed.add(meshes.next(true), kNow + std::chrono::minutes(2));
  EXPECT_EQ(pulse_in(next_take->next()), 3);
}

RC_GTEST_PROP(LiveFeed, sends_no_frame_without_its_predecessor, ()) {
  LiveFeed feed;
  Meshes meshes;
  const auto subscriber = feed.subscribe(kNow);
  int64_t last = -1;
  std::set<int64_t> keys;
  for (const int dice : *rc::gen::container<std::vector<int>>(rc::gen::inRange(0, 20))) {
    const bool key = dice < 3;
    const wire::MeshMessage mesh = meshes.next(key);
    if (key) keys.insert(mesh.pulse);
    if (dice != 19) feed.add(mesh, kNow);  // else it is lost on the network
    if (dice % 3 == 0) {
      const int64_t got = pulse_in(subscriber->next());
      if (got < 0) continue;
      RC_ASSERT(got > last && (got == last + 1 || keys.contains(got)));
      last = got;
    }
  }
}

TEST(LiveFeed, drops_messages_without_a_compact_frame) {
  LiveFeed feed;
  wire::MeshMessage mesh;
  mesh.compact = {1, 2, 3};
  feed.add(mesh, kNow);
  EXPECT_EQ(feed.counts().unusable, 1);
  EXPECT_FALSE(feed.subscribe(kNow)->next());
}

TEST(LiveFeed, counts_frames_before_its_first_key_frame_apart_from_those_after_a_lost_frame) {
  LiveFeed feed;
  Meshes meshes;
  meshes.next(true);  // sent before the start of v3d-viewd
  for (int pulse = 0; pulse < 3; ++pulse) feed.add(meshes.next(false), kNow);
  EXPECT_EQ(feed.counts().early, 3);
  feed.add(meshes.next(true), kNow);
  meshes.next(false);  // lost
  for (int pulse = 0; pulse < 5; ++pulse) feed.add(meshes.next(false), kNow);
  EXPECT_EQ(feed.counts().early, 3);
  EXPECT_EQ(feed.counts().unusable, 5);
}

TEST(DroppedMeshes, have_lines_at_a_bounded_rate_with_their_number) {
  DroppedMeshes dropped;
  LiveFeedCounts counts{.frames = 2000, .early = 7, .outdated = 8, .skipped = 9};
  EXPECT_FALSE(dropped.line(counts, kNow)) << "nothing was lost";
  counts.unusable = 1250;
  EXPECT_THAT(dropped.line(counts, kNow).value_or(""), testing::HasSubstr("1,250 of 2,000"));
  int lines = 0;
  for (int n = 0; n < 1000; ++n) {
    ++counts.unusable;
    if (dropped.line(counts, kNow)) ++lines;
  }
  EXPECT_EQ(lines, 0) << "not doubled within a minute";
  EXPECT_TRUE(dropped.line(counts, kNow + bus::EventThrottle::kAgainAfter));
}

TEST(DroppedMeshes, of_the_relay_process_have_lines_of_their_own) {
  DroppedMeshes dropped;
  EXPECT_FALSE(dropped.line_of_relay(0, kNow));
  EXPECT_THAT(dropped.line_of_relay(3, kNow).value_or(""), testing::HasSubstr("3 live meshes"));
  EXPECT_FALSE(dropped.line_of_relay(3, kNow));
}

}  // namespace
}  // namespace v3d::viewd
