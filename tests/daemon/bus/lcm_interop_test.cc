// Interoperation of the bus with liblcm, in both directions.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <lcm/lcm.h>

#include <algorithm>
#include <memory>
#include <mutex>

#include "daemon/bus/bus.h"
#include "support/child_process.h"

namespace v3d::bus {
namespace {

using test::becomes_true;
using test::within;

constexpr char kUrl[] = "udpm://239.255.76.67:7667?ttl=0&recv_buf_size=4194304";

/// A program on the studio's network that uses liblcm only, like lcm-spy.
class LcmMember {
 public:
  LcmMember() : lcm_(lcm_create(kUrl), lcm_destroy) {
    lcm_subscribe(lcm_.get(), "V3D_.*", on_message, this);
  }
  std::vector<uint8_t> next() {
    received_.clear();
    while (received_.empty() && lcm_handle_timeout(lcm_.get(), 10'000) > 0) {
    }
    return received_;
  }
  void send(const std::string& channel, std::span<const uint8_t> bytes) {
    lcm_publish(lcm_.get(), channel.c_str(), bytes.data(), static_cast<unsigned>(bytes.size()));
  }

 private:
  static void on_message(const lcm_recv_buf_t* in, const char*, void* user) {
    const auto* const bytes = static_cast<const uint8_t*>(in->data);
    static_cast<LcmMember*>(user)->received_.assign(bytes, bytes + in->data_size);
  }
  const std::unique_ptr<lcm_t, decltype(&lcm_destroy)> lcm_;
  std::vector<uint8_t> received_;
};

std::vector<uint8_t> message(size_t size) {
  std::vector<uint8_t> bytes(size);
  for (size_t i = 0; i < size; ++i) bytes[i] = static_cast<uint8_t>(i * 31 + i / 256);
  return bytes;
}

class Interoperation : public testing::TestWithParam<size_t> {};

TEST_P(Interoperation, liblcm_reads_authenticated_messages_followed_by_the_last_trailer) {
  Bus bus(kUrl);
  bus.authenticator().set_key(wire::StudioKey::make());
  LcmMember member;
  const auto sent = message(GetParam());
  ASSERT_TRUE(bus.publish_authenticated("V3D_FRAME_cam01", sent));
  const auto got = member.next();
  ASSERT_EQ(got.size(), sent.size() + wire::kMacTrailerSize);
  EXPECT_TRUE(std::equal(sent.begin(), sent.end(), got.begin()));
}

TEST_P(Interoperation, liblcm_reads_plain_messages_and_the_bus_reads_those_of_liblcm) {
  Bus bus(kUrl);
  std::mutex mutex;
  std::vector<uint8_t> received;
  const auto registration = bus.subscribe("V3D_FRAME_.*", [&](const ReceivedMessage& in) {
    const std::lock_guard lock(mutex);
    received.assign(in.bytes.begin(), in.bytes.end());
  });
  LcmMember member;
  const auto sent = message(GetParam());
  member.send("V3D_FRAME_cam01", sent);
  EXPECT_TRUE(becomes_true(
      [&] {
        const std::lock_guard lock(mutex);
        return received == sent;
      },
      within(10)));
  EXPECT_EQ(member.next(), sent) << "its own message";
  ASSERT_TRUE(bus.publish("V3D_FRAME_cam01", sent));
  EXPECT_EQ(member.next(), sent);
}

/// Sizes in bytes: near the limits of one and of two datagrams, and a raw XGA frame.
INSTANTIATE_TEST_SUITE_P(OfSizes, Interoperation,
                         testing::Values(1, 1000, 65'450, 65'451, 65'483, 65'484, 130'890, 130'895,
                                         130'960, 786'432));

}  // namespace
}  // namespace v3d::bus
