#include "base/io/action_packet.h"

#include <gtest/gtest.h>

namespace v3d::io {
namespace {

using Bytes = std::vector<uint8_t>;

const ActionCommand kPlain{
    .device_key = 0x11223344, .group_key = 0x55667788, .group_mask = 0x99aabbcc, .request = 0x0203};

TEST(ActionPacket, has_the_bytes_of_the_standard) {
  EXPECT_EQ(encode(kPlain), (Bytes{0x42, 0x01, 0x01, 0x00, 0x00, 0x0c, 0x02, 0x03, 0x11, 0x22,
                                   0x33, 0x44, 0x55, 0x66, 0x77, 0x88, 0x99, 0xaa, 0xbb, 0xcc}));
  EXPECT_EQ(encode(ActionAcknowledgement{ActionStatus::kLate, 0x0203}),
            (Bytes{0x80, 0x16, 0x01, 0x01, 0x00, 0x00, 0x02, 0x03}));
}

TEST(ActionPacket, has_the_time_of_a_scheduled_action_as_its_last_eight_bytes) {
  ActionCommand command = kPlain;
  command.time_ns = 0x0102030405060708;
  command.wants_acknowledgement = false;
  const Bytes bytes = encode(command);
  ASSERT_EQ(bytes.size(), 28U);
  EXPECT_EQ(Bytes(bytes.begin(), bytes.begin() + 8),
            (Bytes{0x42, 0x80, 0x01, 0x00, 0x00, 0x14, 0x02, 0x03}));
  EXPECT_EQ(Bytes(bytes.begin() + 20, bytes.end()), (Bytes{1, 2, 3, 4, 5, 6, 7, 8}));
}

TEST(ActionPacket, is_decoded_as_it_was_encoded) {
  ActionCommand scheduled = kPlain;
  scheduled.time_ns = 1'700'000'000'123'456'789;
  for (const ActionCommand& command : {kPlain, scheduled}) {
    EXPECT_EQ(decode_action_command(encode(command)), command);
  }
  const ActionAcknowledgement acknowledgement{ActionStatus::kNoReferenceTime, 65'535};
  EXPECT_EQ(decode_action_acknowledgement(encode(acknowledgement)), acknowledgement);
}

TEST(ActionPacket, is_rejected_when_it_is_cut_or_changed) {
  const Bytes good = encode(kPlain);
  for (size_t size = 0; size < good.size(); ++size) {
    EXPECT_FALSE(decode_action_command(std::span(good).first(size))) << size;
  }
  Bytes long_one = good;
  long_one.push_back(0);
  EXPECT_FALSE(decode_action_command(long_one));
  for (const size_t at : {0, 2, 3, 4, 5}) {
    Bytes changed = good;
    changed[at] ^= 2;
    EXPECT_FALSE(decode_action_command(changed)) << "byte " << at;
  }
  Bytes scheduled_without_time = good;
  scheduled_without_time[1] |= 0x80;
  EXPECT_FALSE(decode_action_command(scheduled_without_time));
  EXPECT_FALSE(decode_action_acknowledgement(good));
  EXPECT_FALSE(decode_action_command(encode(ActionAcknowledgement{})));
}

TEST(ActionPacket, names_the_status_of_an_acknowledgement) {
  EXPECT_EQ(text_of(ActionStatus::kNoReferenceTime), "no PTP time");
  EXPECT_EQ(text_of(static_cast<ActionStatus>(0x80a1)), "status 0x80a1");
}

}  // namespace
}  // namespace v3d::io
