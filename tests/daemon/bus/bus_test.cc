// Tests of the bus with real multicast, in a network namespace.
#include "daemon/bus/bus.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sched.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cstdio>
#include <fstream>
#include <iterator>
#include <mutex>
#include <thread>

#include "base/core/error.h"
#include "daemon/bus/multicast_socket.h"
#include "support/child_process.h"
#include "support/message_of.h"
#include "support/raw_datagrams.h"
#include "wire/messages.h"
#include "wire/secret_keys.h"

namespace v3d::bus {
namespace {

using test::becomes_true;
using test::within;
using testing::ElementsAre;
using testing::IsEmpty;
using testing::UnorderedElementsAre;

constexpr char kUrl[] = "udpm://239.255.76.67:7667?ttl=0";

wire::EventMessage event(int64_t seq) {
  wire::EventMessage m;
  m.seq = seq;
  m.node = "cap01";
  return m;
}

TEST(Bus, carries_messages_between_two_connections) {
  Bus sender(kUrl);
  Bus receiver(kUrl);
  Subscription<wire::EventMessage> events(receiver, wire::kEventChannel, 8);
  ASSERT_TRUE(sender.publish(wire::kEventChannel, encode(event(3))));
  const auto got = events.wait(within(10));
  ASSERT_TRUE(got);
  EXPECT_EQ(got->seq, 3);
  EXPECT_EQ(got->node, "cap01");
}

TEST(Bus, carries_a_message_of_several_datagrams) {
  Bus bus(kUrl);
  Subscription<wire::FrameMessage> frames(bus, "V3D_FRAME_.*", 2);
  wire::FrameMessage m;
  m.frame.camera = "cam07";
  m.frame.sensor_size = {320, 240};
  m.frame.roi = {0, 0, 320, 240};
  m.frame.image = Image({320, 240}, PixelFormat::kBayerRG8);
  m.frame.image.bytes[70'000] = 77;
  bus.publish(wire::frame_channel("cam07"), encode(m));
  const auto got = frames.wait(within(10));
  ASSERT_TRUE(got);
  EXPECT_EQ(got->frame.image.bytes[70'000], 77);
}

class FrameGroups : public testing::Test {
 protected:
  void send(int64_t pulse) {
    sender_.publish_frame(pulse, wire::frame_channel("cam07"), encode(frame_of(pulse)));
  }
  static wire::FrameMessage frame_of(int64_t pulse) {
    wire::FrameMessage message;
    FrameLabel label;
    label.pulse = pulse;
    const Image raw({16, 8}, PixelFormat::kBayerRG8);
    message.frame = observe("cam07", label, raw.view(), Mask({16, 8}));
    return message;
  }
  /// Receives frames until that of pulse `last`; returns their pulses.
  std::vector<int64_t> until(int64_t last) {
    std::vector<int64_t> pulses;
    while (const auto frame = frames_.wait(within(10))) {
      pulses.push_back(frame->frame.label.pulse);
      if (pulses.back() == last) break;
    }
    return pulses;
  }

  /// Receives `count` frames; returns their pulses.
  std::vector<int64_t> next(size_t count) {
    std::vector<int64_t> pulses;
    while (pulses.size() < count) {
      const auto frame = frames_.wait(within(10));
      if (!frame) break;
      pulses.push_back(frame->frame.label.pulse);
    }
    return pulses;
  }
  /// The frame groups of which this host is a member.
  static std::vector<int> joined() {
    std::ifstream file("/proc/net/igmp");
    const std::string memberships((std::istreambuf_iterator<char>(file)), {});
    std::vector<int> groups;
    for (int i = 0; i < 3; ++i) {
      std::array<char, 9> hex{};
      std::snprintf(hex.data(), hex.size(), "%02X4CFFEF", 68 + i);
      if (memberships.find(hex.data()) != std::string::npos) groups.push_back(i);
    }
    return groups;
  }

  const std::vector<std::string> urls_ = {"udpm://239.255.76.68:7668?ttl=0",
                                          "udpm://239.255.76.69:7669?ttl=0",
                                          "udpm://239.255.76.70:7670?ttl=0"};
  Bus sender_{kUrl, urls_};
  Bus receiver_{kUrl, urls_};
  Subscription<wire::FrameMessage> frames_{receiver_, "V3D_FRAME_.*", 100};
};

TEST_F(FrameGroups, deliver_the_frames_of_their_pulses_only) {
  receiver_.join_frame_groups({1});
  for (int64_t pulse = 0; pulse < 11; ++pulse) send(pulse);
  EXPECT_EQ(until(10), (std::vector<int64_t>{1, 4, 7, 10}));
}

TEST_F(FrameGroups, are_joined_and_left_while_frames_arrive) {
  receiver_.join_frame_groups({0});
  for (int64_t pulse = 0; pulse < 4; ++pulse) send(pulse);
  EXPECT_EQ(until(3), (std::vector<int64_t>{0, 3}));
  receiver_.join_frame_groups({0, 1, 2});
  for (int64_t pulse = 4; pulse < 7; ++pulse) send(pulse);
  EXPECT_THAT(next(3), UnorderedElementsAre(4, 5, 6)) << "groups are not ordered";
  receiver_.join_frame_groups({2});
  for (int64_t pulse = 9; pulse < 12; ++pulse) send(pulse);
  EXPECT_THAT(until(11), testing::Not(testing::Contains(9)));
}

TEST_F(FrameGroups, do_not_change_other_channels) {
  Bus without_groups(kUrl);
  Subscription<wire::EventMessage> events(without_groups, wire::kEventChannel, 8);
  Subscription<wire::EventMessage> events_too(receiver_, wire::kEventChannel, 8);
  receiver_.join_frame_groups({0, 1, 2});
  ASSERT_TRUE(sender_.publish(wire::kEventChannel, encode(event(3))));
  EXPECT_TRUE(events.wait(within(10)));
  EXPECT_TRUE(events_too.wait(within(10)));
  EXPECT_EQ(events_too.counts().received, 1);
}

TEST_F(FrameGroups, are_joined_by_receivers_and_not_by_senders) {
  send(0);
  EXPECT_THAT(joined(), IsEmpty());
  receiver_.join_frame_groups({1, 2});
  EXPECT_THAT(joined(), ElementsAre(1, 2));
  receiver_.join_frame_groups({2});
  EXPECT_TRUE(becomes_true([] { return joined() == std::vector{2}; }, within(10)));
}

TEST_F(FrameGroups, count_as_one_when_the_studio_has_none) {
  Bus one(kUrl);
  EXPECT_EQ(one.frame_groups(), 1U);
  EXPECT_EQ(sender_.frame_groups(), 3U);
  Subscription<wire::FrameMessage> frames(one, "V3D_FRAME_.*", 8);
  one.publish_frame(5, wire::frame_channel("cam07"), encode(frame_of(5)));
  EXPECT_TRUE(frames.wait(within(10)));
}

TEST(Subscription, counts_dropped_lost_and_undecodable_messages) {
  Bus bus(kUrl);
  Subscription<wire::EventMessage> events(bus, wire::kEventChannel, 2);
  for (const int64_t seq : {0, 1, 2, 7}) bus.publish(wire::kEventChannel, encode(event(seq)));
  bus.publish(wire::kEventChannel, wire::Bytes{1, 2, 3});
  bus.publish(wire::kEventChannel, encode(wire::PulseMessage{}));
  ASSERT_TRUE(becomes_true([&] { return events.counts().undecodable == 2; }, within(10)));
  EXPECT_EQ(events.counts().received, 4);
  EXPECT_EQ(events.counts().dropped, 2);
  EXPECT_EQ(events.counts().lost, 4);
  EXPECT_EQ(events.wait(within(10))->seq, 2);
}

TEST(Subscription, may_end_before_the_bus) {
  Bus bus(kUrl);
  { const Subscription<wire::EventMessage> gone(bus, wire::kEventChannel, 2); }
  Subscription<wire::EventMessage> events(bus, wire::kEventChannel, 2);
  bus.publish(wire::kEventChannel, encode(event(0)));
  EXPECT_TRUE(events.wait(within(10)));
}

TEST(Subscription, accepts_only_authentic_messages_when_there_is_a_key) {
  Bus bus(kUrl);
  bus.authenticator().set_key(wire::StudioKey::make());
  Subscription<wire::EventMessage> events(bus, wire::kEventChannel, 8);
  Bus attacker(kUrl);
  attacker.authenticator().set_key(wire::StudioKey::make());
  bus.publish(wire::kEventChannel, encode(event(0)));
  attacker.publish_authenticated(wire::kEventChannel, encode(event(1)));
  bus.publish_authenticated(wire::kEventChannel, encode(event(2)));
  const auto got = events.wait(within(10));
  ASSERT_TRUE(got);
  EXPECT_EQ(got->seq, 2);
  EXPECT_EQ(bus.authenticator().counts().forged, 2);
}

TEST(Subscription, counts_equal_messages_that_were_sent_separately_as_no_replay) {
  Bus bus(kUrl);
  bus.authenticator().set_key(wire::StudioKey::make());
  Subscription<wire::EventMessage> events(bus, wire::kEventChannel, 8);
  for (int i = 0; i < 4; ++i) bus.publish_authenticated(wire::kEventChannel, encode(event(7)));
  for (int i = 0; i < 4; ++i) ASSERT_TRUE(events.wait(within(10)));
  EXPECT_EQ(bus.authenticator().counts().replayed, 0);
}

TEST(Subscription, rejects_health_of_a_node_on_the_channel_of_another) {
  Bus bus(kUrl);
  bus.authenticator().set_key(wire::StudioKey::make());
  Subscription<wire::HealthMessage> health(bus, "V3D_HEALTH_.*", 8);
  wire::HealthMessage idle;
  idle.node = "cap02";
  idle.sent = Realtime::now();
  // Messages are dropped until the session has responded to a challenge.
  ASSERT_TRUE(becomes_true(
      [&] {
        bus.publish_authenticated(wire::health_channel("cap01"), encode(idle));
        return health.counts().undecodable > 0;
      },
      within(10)));
  EXPECT_EQ(health.counts().received, 0);
}

/// A studio of two capture nodes with a member list.
class MemberBuses : public testing::Test {
 protected:
  MemberBuses() {
    studio_.nodes = {{"cap01"}, {"cap02"}, {"recon01"}};
    studio_.trigger.node = "cap01";
    studio_.cameras.resize(1);
    studio_.cameras[0].name = "cam01";
    studio_.cameras[0].node = "cap01";
  }
  std::unique_ptr<Bus> bus_of(const wire::SigningKey& key,
                              const std::vector<std::string>& frame_groups = {}) const {
    auto bus = std::make_unique<Bus>(kUrl, frame_groups, ChannelList(studio_));
    bus->authenticator().set_key(studio_key_);
    bus->authenticator().members().require();
    bus->authenticator().members().set_members(std::make_shared<const wire::MemberList>(
        wire::MemberList{"kyoto",
                         1,
                         {{"cap01", wire::Role::kCapture, cap01_.public_key()},
                          {"cap02", wire::Role::kCapture, cap02_.public_key()},
                          {"recon01", wire::Role::kReconstruction, recon01_.public_key()}}}));
    bus->authenticator().members().set_signing_key(key);
    return bus;
  }

  Studio studio_;
  const wire::StudioKey studio_key_ = wire::StudioKey::make();
  const wire::SigningKey cap01_ = wire::SigningKey::make(), cap02_ = wire::SigningKey::make(),
                         recon01_ = wire::SigningKey::make();
};

TEST_F(MemberBuses, accept_events_only_from_the_node_that_they_name) {
  const auto cap01 = bus_of(cap01_), cap02 = bus_of(cap02_), listener = bus_of(cap02_);
  Subscription<wire::EventMessage> events(*listener, wire::kEventChannel, 8);
  cap02->publish_authenticated(wire::kEventChannel, encode(event(1)));
  cap01->publish_authenticated(wire::kEventChannel, encode(event(2)));
  EXPECT_EQ(events.wait(within(10)).value().seq, 2);
  EXPECT_EQ(listener->authenticator().counts().not_signed, 1);
}

TEST_F(MemberBuses, accept_health_and_pulses_when_their_member_has_responded) {
  const auto cap01 = bus_of(cap01_), listener = bus_of(cap02_);
  // A bus responds to challenges only while it has a subscription.
  Subscription<wire::EventMessage> responder(*cap01, wire::kEventChannel, 8);
  Subscription<wire::PulseMessage> pulses(*listener, wire::kPulseChannel, 8);
  Subscription<wire::HealthMessage> health(*listener, wire::health_channel("cap01"), 8);
  wire::HealthMessage idle;
  idle.node = "cap01";
  const auto arrive = [&] {
    cap01->publish_authenticated(wire::kPulseChannel, encode(wire::PulseMessage{}));
    cap01->publish_authenticated(wire::health_channel("cap01"), encode(idle));
    return pulses.counts().received > 0 && health.counts().received > 0;
  };
  EXPECT_TRUE(becomes_true(arrive, within(10)));
  EXPECT_EQ(listener->authenticator().counts().not_signed, 0);
}

/// One announcement is enough: cap01 repeats it when it has responded to the challenge of recon01.
TEST_F(MemberBuses, carry_frames_with_the_key_that_their_node_announced) {
  const std::vector<std::string> groups = {"udpm://239.255.76.68:7668?ttl=0",
                                           "udpm://239.255.76.69:7669?ttl=0"};
  for (const auto& frame_groups : {std::vector<std::string>{}, groups}) {
    const auto cap01 = bus_of(cap01_, frame_groups), cap02 = bus_of(cap02_, frame_groups),
               recon01 = bus_of(recon01_, frame_groups);
    recon01->join_frame_groups(all_frame_groups(recon01->frame_groups()));
    Subscription<wire::EventMessage> responder(*cap01, wire::kEventChannel, 8);
    Subscription<wire::FrameMessage> frames(*recon01, wire::frame_channel("cam01"), 100);
    wire::FrameMessage message;
    message.frame.camera = "cam01";
    message.frame.sensor_size = {320, 240};
    message.frame.roi = {0, 0, 320, 240};
    message.frame.image = Image({320, 240}, PixelFormat::kBayerRG8);
    const auto publish = [&](Bus& from, int64_t seq) {
      message.seq = seq;
      return from.publish_frame(seq, wire::frame_channel("cam01"), encode(message));
    };
    EXPECT_FALSE(publish(*cap01, 0)) << "there is no key";
    cap02->announce_frame_key("cap02");
    cap01->announce_frame_key("cap01");
    int64_t seq = 0;
    const auto arrives = [&] {
      EXPECT_TRUE(publish(*cap02, 5000 + ++seq));
      EXPECT_TRUE(publish(*cap01, seq));
      return frames.wait(Monotonic::now() + std::chrono::milliseconds(50)).has_value();
    };
    EXPECT_TRUE(becomes_true(arrives, within(10)));
    EXPECT_TRUE(publish(*cap02, 5000 + ++seq));
    EXPECT_TRUE(publish(*cap01, ++seq));
    for (auto got = frames.wait(within(10)); got; got = frames.wait(within(10))) {
      EXPECT_LT(got->seq, 5000);
      if (got->seq == seq) break;
    }
    EXPECT_EQ(recon01->authenticator().counts().forged, 0);
  }
}

TEST_F(MemberBuses, send_a_signature_after_a_message_only_when_members_are_required) {
  const test::RawSocket network(kUrl);
  const wire::Bytes message = encode(event(1));
  const auto signed_bus = bus_of(cap01_);
  signed_bus->publish_authenticated(wire::kEventChannel, message);
  const auto with_signature = network.receive(std::chrono::seconds(10));
  Bus plain(kUrl);
  plain.authenticator().set_key(studio_key_);
  plain.publish_authenticated(wire::kEventChannel, message);
  const auto without = network.receive(std::chrono::seconds(10));
  EXPECT_EQ(without.size(),
            8 + sizeof wire::kEventChannel + message.size() + wire::kMacTrailerSize);
  EXPECT_EQ(with_signature.size(), without.size() + wire::kMessageSignatureSize);
}

TEST(Subscription, reads_authenticated_messages_without_a_key) {
  Bus sender(kUrl);
  sender.authenticator().set_key(wire::StudioKey::make());
  Bus receiver(kUrl);
  Subscription<wire::EventMessage> events(receiver, wire::kEventChannel, 8);
  sender.publish_authenticated(wire::kEventChannel, encode(event(3)));
  EXPECT_EQ(events.wait(within(10)).value().seq, 3);
}

TEST(Subscription, rejects_all_messages_without_a_key_when_authentication_is_required) {
  Bus bus(kUrl);
  bus.authenticator().require_authentication();
  Subscription<wire::EventMessage> events(bus, wire::kEventChannel, 8);
  bus.publish_authenticated(wire::kEventChannel, encode(event(3)));
  ASSERT_TRUE(becomes_true([&] { return bus.authenticator().counts().unkeyed == 1; }, within(10)));
  EXPECT_EQ(events.counts().received, 0);
}

TEST(Bus, releases_an_ended_handler_and_keeps_calling_the_others) {
  Bus bus(kUrl);
  Subscription<wire::EventMessage> others(bus, wire::kEventChannel, 8);
  auto mine = std::make_shared<std::atomic<int>>(0);
  std::optional<Bus::HandlerRegistration> registration(
      bus.subscribe(wire::kEventChannel, [mine](const ReceivedMessage&) { ++*mine; }));
  bus.publish(wire::kEventChannel, encode(event(1)));
  ASSERT_TRUE(becomes_true([&] { return *mine == 1; }, within(10)));
  registration.reset();
  EXPECT_EQ(mine.use_count(), 1);
  bus.publish(wire::kEventChannel, encode(event(2)));
  ASSERT_TRUE(becomes_true([&] { return others.counts().received == 2; }, within(10)));
  EXPECT_EQ(*mine, 1);
}

TEST(Bus, reports_the_field_of_a_malformed_url) {
  const std::string message = test::message_of<InputError>([] { Bus bus("nonsense://"); });
  EXPECT_THAT(message, testing::HasSubstr("network.lcm_url: cannot join nonsense://"));
  EXPECT_THAT(message, testing::HasSubstr("expected udpm://"));
}

// systemd does not start a daemon again that ended with an InputError.
TEST(Bus, reports_the_remedy_without_a_route_and_not_as_wrong_input) {
  std::string message;
  bool is_input_error = false, has_namespace = false;
  std::jthread([&] {
    has_namespace = unshare(CLONE_NEWNET) == 0;  // of this thread only
    if (!has_namespace) return;
    try {
      Bus bus(kUrl);
    } catch (const InputError&) {
      is_input_error = true;
    } catch (const std::runtime_error& error) {
      message = error.what();
    }
  }).join();
  if (!has_namespace) GTEST_SKIP() << "a network namespace needs root";
  EXPECT_FALSE(is_input_error);
  EXPECT_THAT(message, testing::HasSubstr("ip route add"));
}

TEST(Bus, reports_an_option_that_is_not_a_number) {
  const std::string message = test::message_of<InputError>([] { Bus bus("udpm://?ttl=far"); });
  EXPECT_THAT(message, testing::HasSubstr("ttl=0 to 255"));
}

TEST(Bus, counts_datagrams_that_the_kernel_drops_while_a_handler_blocks) {
  Bus bus(kUrl);
  std::mutex busy;
  std::unique_lock held(busy);
  const auto registration = bus.subscribe(
      "V3D_FRAME_.*", [&](const ReceivedMessage&) { const std::lock_guard wait(busy); });
  const std::vector<uint8_t> frame(60'000);
  // More than the ring and the buffer of the kernel hold together.
  constexpr size_t kCount = DatagramRing::kPlaces + 300;
  for (size_t i = 0; i < kCount; ++i) bus.publish("V3D_FRAME_cam01", frame);
  held.unlock();
  EXPECT_TRUE(becomes_true(
      [&] {
        bus.publish("V3D_FRAME_cam01", frame);
        return bus.reception().dropped_by_kernel > 0;
      },
      within(10)));
}

TEST(Bus, carries_a_reply_of_several_datagrams_and_verifies_each) {
  const wire::StudioKey key = wire::StudioKey::make();
  Bus node(kUrl);
  node.authenticator().set_key(key);
  Bus operator_bus(kUrl);
  operator_bus.authenticator().set_key(key);
  Subscription<wire::ReplyMessage> replies(
      operator_bus, wire::kReplyChannel, 4,
      [key](const ReceivedMessage& in) -> std::optional<wire::ReplyMessage> {
        if (!key.has_valid_mac(in.bytes)) return std::nullopt;
        return wire::decode<wire::ReplyMessage>(in.bytes);
      });
  wire::ReplyMessage reply;
  reply.detail = std::string(200'000, ' ');
  ASSERT_TRUE(node.publish(wire::kReplyChannel, encode_with_mac(reply, key)));
  ASSERT_TRUE(
      becomes_true([&] { return operator_bus.authenticator().counts().forged == 4; }, within(10)));
  ASSERT_TRUE(node.publish_reply(encode_with_mac(reply, key)));
  EXPECT_EQ(replies.wait(within(10)).value().detail, reply.detail);
}

/// The largest receive buffer that the kernel grants, bytes.
int largest_receive_buffer() {
  const int socket = ::socket(AF_INET, SOCK_DGRAM, 0);
  const int wanted = 1 << 30;
  int reported = 0;
  socklen_t size = sizeof reported;
  setsockopt(socket, SOL_SOCKET, SO_RCVBUF, &wanted, sizeof wanted);
  getsockopt(socket, SOL_SOCKET, SO_RCVBUF, &reported, &size);
  close(socket);
  return reported / 2;
}

TEST(ReceiveBuffer, is_a_problem_when_the_kernel_grants_less_than_the_url_requests) {
  const auto url = [](int bytes) {
    return "udpm://239.255.76.67:7667?ttl=0&recv_buf_size=" + std::to_string(bytes);
  };
  const int limit = largest_receive_buffer();
  EXPECT_EQ(receive_buffer_problem(url(limit)), "");
  EXPECT_THAT(receive_buffer_problem(url(limit + limit / 2)),
              testing::HasSubstr("sysctl net.core.rmem_max=" + std::to_string(limit + limit / 2)));
  EXPECT_EQ(receive_buffer_problem(kUrl), "") << "requests no size";
}

}  // namespace
}  // namespace v3d::bus
