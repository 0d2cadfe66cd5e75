// Tests of the multicast sockets and of the ring between the receiving and the handling thread, in
// a network namespace.
#include "daemon/bus/multicast_socket.h"

#include <gtest/gtest.h>

#include <thread>
#include <vector>

#include "support/child_process.h"

namespace v3d::bus {
namespace {

using test::becomes_true;
using test::within;

constexpr char kUrl[] = "udpm://239.255.76.67:7667?ttl=0";

class DatagramRingTest : public testing::Test {
 protected:
  /// Sends one datagram and receives it into the ring.
  void pass(uint8_t value, size_t bytes) {
    const std::vector<uint8_t> message(bytes, value);
    ASSERT_TRUE(sender_.send("V3D_EVENT", message, nullptr));
    ASSERT_TRUE(becomes_true([&] { return receiver_.receive(ring_) == 1; }, within(10)));
  }
  /// Handles `count` datagrams and appends the last byte of each to `values`.
  void handle(size_t count, std::vector<uint8_t>& values) {
    while (count > 0) {
      const auto datagrams = ring_.wait(count);
      for (const auto& datagram : datagrams) values.push_back(datagram.bytes.back());
      ring_.release(datagrams.size());
      count -= datagrams.size();
    }
  }

  MulticastSender sender_{kUrl};
  MulticastReceiver receiver_{kUrl};
  DatagramRing ring_;
};

TEST_F(DatagramRingTest, stores_more_datagrams_than_the_kernel_while_none_is_handled) {
  constexpr size_t kMany = 300;
  for (size_t i = 0; i < kMany; ++i) pass(static_cast<uint8_t>(i), 60'000);
  std::vector<uint8_t> values;
  handle(kMany, values);
  for (size_t i = 0; i < kMany; ++i) ASSERT_EQ(values[i], static_cast<uint8_t>(i));
  EXPECT_EQ(receiver_.dropped(), 0);
}

TEST_F(DatagramRingTest, returns_datagrams_in_order_across_its_end) {
  std::vector<uint8_t> values;
  for (size_t i = 0; i < 2 * DatagramRing::kPlaces; i += 7) {
    for (size_t k = 0; k < 7; ++k) pass(static_cast<uint8_t>(i + k), 100);
    handle(7, values);
  }
  for (size_t i = 0; i < values.size(); ++i) ASSERT_EQ(values[i], static_cast<uint8_t>(i));
}

TEST_F(DatagramRingTest, leaves_datagrams_in_the_kernel_while_it_is_full) {
  for (size_t i = 0; i < DatagramRing::kPlaces; ++i) pass(static_cast<uint8_t>(i), 10);
  const std::vector<uint8_t> last = {99};
  ASSERT_TRUE(sender_.send("V3D_EVENT", last, nullptr));
  std::thread receiving([&] {
    EXPECT_TRUE(becomes_true([&] { return receiver_.receive(ring_) == 1; }, within(10)));
  });
  std::vector<uint8_t> values;
  handle(DatagramRing::kPlaces + 1, values);
  receiving.join();
  EXPECT_EQ(values.back(), 99);
}

TEST_F(DatagramRingTest, wakes_both_threads_when_it_is_stopped) {
  std::thread handling([&] { EXPECT_TRUE(ring_.wait().empty()); });
  ring_.stop();
  handling.join();
  EXPECT_EQ(receiver_.receive(ring_), 0U);
}

}  // namespace
}  // namespace v3d::bus
