#include "daemon/bus/datagram.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <numeric>

#include "support/raw_datagrams.h"

namespace v3d::bus {
namespace {

using test::fragment_header;
using test::put32;
using test::put_text;
using test::RawDatagram;
using test::RawFragment;
using test::short_datagram;

RawDatagram bytes_of(const OutgoingDatagram& datagram, bool with_trailer) {
  RawDatagram bytes(datagram.head().begin(), datagram.head().end());
  bytes.insert(bytes.end(), datagram.data.begin(), datagram.data.end());
  const auto trailer = datagram.trailer.bytes();
  if (with_trailer) bytes.insert(bytes.end(), trailer.begin(), trailer.end());
  return bytes;
}

std::vector<uint8_t> any_message(size_t size) {
  std::vector<uint8_t> message(size);
  std::iota(message.begin(), message.end(), uint8_t{1});
  return message;
}

/// The first fragment of a message on `channel`, with `data` bytes of data.
RawDatagram first_fragment(const RawFragment& fragment, std::string_view channel, size_t data) {
  RawDatagram bytes = fragment_header(fragment);
  put_text(bytes, channel);
  bytes.push_back(0);
  bytes.resize(bytes.size() + data);
  return bytes;
}
RawDatagram later_fragment(const RawFragment& fragment, size_t data) {
  RawDatagram bytes = fragment_header(fragment);
  bytes.resize(bytes.size() + data);
  return bytes;
}

TEST(Datagram, of_a_short_message_contains_number_channel_and_data) {
  const auto message = any_message(10);
  const auto sent = split_message(77, "V3D_EVENT", message, false);
  ASSERT_EQ(sent.size(), 1U);
  const RawDatagram bytes = bytes_of(sent[0], false);
  const auto parsed = parse_datagram(bytes);
  ASSERT_TRUE(parsed);
  EXPECT_EQ(parsed->sequence, 77U);
  EXPECT_EQ(parsed->channel, "V3D_EVENT");
  EXPECT_TRUE(parsed->is_whole());
  EXPECT_THAT(parsed->data, testing::ElementsAreArray(message));
}

TEST(Datagram, is_rejected_without_a_NUL_after_a_channel_of_at_most_63_bytes) {
  EXPECT_FALSE(parse_datagram(short_datagram(1, "V3D_COMMAND")));
  EXPECT_FALSE(parse_datagram(short_datagram(1, std::string(64, 'a') + '\0')));
  EXPECT_TRUE(parse_datagram(short_datagram(1, std::string(63, 'a') + '\0')));
  EXPECT_FALSE(parse_datagram(short_datagram(1, std::string(1, '\0')))) << "without a name";
  EXPECT_FALSE(parse_datagram(short_datagram(1, "")));
}

TEST(Datagram, is_rejected_when_offset_and_size_wrap_32_bits_or_end_beyond_the_message) {
  EXPECT_FALSE(parse_datagram(
      later_fragment({.message_size = 1000, .offset = 0xffffffff, .number = 1, .count = 2}, 10)));
  EXPECT_FALSE(parse_datagram(
      later_fragment({.message_size = 1000, .offset = 999, .number = 1, .count = 3}, 2)));
  EXPECT_TRUE(parse_datagram(
      later_fragment({.message_size = 1000, .offset = 998, .number = 1, .count = 3}, 2)));
}

TEST(Datagram, is_rejected_when_the_message_exceeds_the_limit_or_its_fragments) {
  EXPECT_FALSE(parse_datagram(first_fragment(
      {.message_size = 256U << 20, .offset = 0, .number = 0, .count = 65535}, "V3D_PULSE", 20)));
  EXPECT_FALSE(parse_datagram(first_fragment(
      {.message_size = kMaxMessage, .offset = 0, .number = 0, .count = 2}, "V3D_PULSE", 20)));
  EXPECT_FALSE(parse_datagram(first_fragment(
      {.message_size = 1000, .offset = 0, .number = 0, .count = 65535}, "V3D_PULSE", 20)));
}

TEST(Datagram, is_rejected_when_number_count_offset_and_size_are_inconsistent) {
  EXPECT_FALSE(parse_datagram(
      later_fragment({.message_size = 1000, .offset = 10, .number = 2, .count = 2}, 10)));
  EXPECT_FALSE(parse_datagram(
      later_fragment({.message_size = 1000, .offset = 10, .number = 0, .count = 0}, 10)));
  EXPECT_FALSE(parse_datagram(
      first_fragment({.message_size = 1000, .offset = 5, .number = 0, .count = 2}, "V3D_MESH", 10)))
      << "the first begins at 0";
  EXPECT_FALSE(parse_datagram(
      later_fragment({.message_size = 1000, .offset = 10, .number = 1, .count = 2}, 10)))
      << "the last ends with the message";
  EXPECT_FALSE(parse_datagram(
      later_fragment({.message_size = 1000, .offset = 1000, .number = 1, .count = 3}, 0)))
      << "without data";
}

/// A sanitizer, or the page after the bytes, detects a read out of bounds.
RC_GTEST_PROP(Datagram, is_parsed_within_its_bytes_for_any_input, ()) {
  auto bytes = *rc::gen::container<std::vector<uint8_t>>(rc::gen::arbitrary<uint8_t>());
  const std::string magic = *rc::gen::element<std::string>("LC02", "LC03", "LC04");
  std::copy_n(magic.begin(), std::min<size_t>(4, bytes.size()), bytes.begin());
  const auto parsed = parse_datagram(bytes);
  if (!parsed) return;
  const uint8_t* const end = bytes.data() + bytes.size();
  RC_ASSERT(parsed->head.data() == bytes.data());
  RC_ASSERT(parsed->head.data() + parsed->head.size() == parsed->data.data());
  RC_ASSERT(parsed->data.data() + parsed->data.size() == end);
  RC_ASSERT(uint64_t{parsed->offset} + parsed->data.size() <= parsed->message_size);
  RC_ASSERT(parsed->number < parsed->count);
}

RC_GTEST_PROP(Datagrams, of_a_message_reassemble_to_the_message, ()) {
  const bool with_trailer = *rc::gen::arbitrary<bool>();
  const auto size = static_cast<size_t>(*rc::gen::weightedElement<int>({{1, 0},
                                                                        {1, 65'430},
                                                                        {1, 65'455},
                                                                        {1, 65'487},
                                                                        {1, 65'499},
                                                                        {1, 131'000},
                                                                        {1, 786'432}}) +
                                        *rc::gen::inRange(0, 64));
  const auto message = any_message(size);
  std::vector<uint8_t> joined;
  uint32_t number = 0;
  for (const auto& sent : split_message(5, "V3D_FRAME_cam01", message, with_trailer)) {
    const RawDatagram bytes = bytes_of(sent, with_trailer);
    RC_ASSERT(bytes.size() <= kMaxDatagram);
    const auto parsed = parse_datagram(bytes);
    RC_ASSERT(parsed.has_value());
    const DatagramParts parts = split_trailer(*parsed);
    RC_ASSERT(parts.trailer.has_value() == with_trailer);
    RC_ASSERT(parsed->number == number++);
    RC_ASSERT(parsed->offset == joined.size());
    joined.insert(joined.end(), parts.data.begin(), parts.data.end());
  }
  RC_ASSERT(joined == message);
}

TEST(Datagrams, are_empty_for_a_message_or_a_name_that_is_too_long) {
  EXPECT_THAT(split_message(1, std::string(64, 'a'), any_message(3), false), testing::IsEmpty());
  const std::vector<uint8_t> longest(kMaxMessage);
  EXPECT_THAT(split_message(1, "V3D_MESH", longest, false), testing::SizeIs(257));
  EXPECT_THAT(split_message(1, "V3D_MESH", longest, true), testing::IsEmpty());
}

}  // namespace
}  // namespace v3d::bus
