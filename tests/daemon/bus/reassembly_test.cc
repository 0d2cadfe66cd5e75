#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>

#include "daemon/bus/datagram.h"

namespace v3d::bus {
namespace {

/// A message cut into fragments of `piece` bytes.
struct Cut {
  std::vector<uint8_t> bytes;
  std::vector<MessageFragment> fragments;

  Cut(uint32_t sequence, size_t size, size_t piece, uint64_t sender = 1) : bytes(size) {
    for (size_t i = 0; i < size; ++i) bytes[i] = static_cast<uint8_t>(i * 7 + sequence);
    const size_t count = (size + piece - 1) / piece;
    const MessageIdentity of = {.sender = sender,
                                .sequence = sequence,
                                .size = static_cast<uint32_t>(size),
                                .count = static_cast<uint16_t>(count)};
    for (size_t i = 0; i < count; ++i) {
      const auto data = std::span<const uint8_t>(bytes).subspan(i * piece);
      fragments.push_back({.of = of,
                           .number = static_cast<uint16_t>(i),
                           .offset = static_cast<uint32_t>(i * piece),
                           .channel = i == 0 ? "V3D_MESH" : "",
                           .data = data.first(std::min(piece, data.size()))});
    }
  }
};

RC_GTEST_PROP(Reassembly, returns_the_message_for_any_order_and_repetition_of_its_fragments, ()) {
  static Reassembly reassembly;  // 64 MiB: one for all cases
  static uint32_t sequence = 0;
  const auto piece = *rc::gen::inRange<size_t>(1, 100);
  const Cut cut(++sequence, *rc::gen::inRange<size_t>(piece + 1, 20 * piece + 2), piece);
  auto order =
      *rc::gen::container<std::vector<size_t>>(rc::gen::inRange<size_t>(0, cut.fragments.size()));
  for (size_t i = 0; i < cut.fragments.size(); ++i) {
    if (std::ranges::find(order, i) == order.end()) order.push_back(i);
  }
  std::vector<bool> arrived(cut.fragments.size());
  for (const size_t i : order) {
    arrived[i] = true;
    const bool whole = std::ranges::find(arrived, false) == arrived.end();
    const auto message = reassembly.add(cut.fragments[i]);
    RC_ASSERT(message.has_value() == whole);
    if (!whole) continue;
    RC_ASSERT(message->channel == "V3D_MESH");
    RC_ASSERT(std::ranges::equal(message->bytes, cut.bytes));
    break;
  }
}

TEST(Reassembly, separates_messages_of_several_senders) {
  Reassembly reassembly;
  const Cut a(1, 300, 100, 1);
  const Cut b(1, 300, 100, 2);
  for (size_t i = 0; i < 2; ++i) {
    EXPECT_FALSE(reassembly.add(a.fragments[i]));
    EXPECT_FALSE(reassembly.add(b.fragments[i]));
  }
  EXPECT_TRUE(reassembly.add(a.fragments[2]));
  EXPECT_TRUE(reassembly.add(b.fragments[2]));
}

TEST(Reassembly, discards_the_oldest_message_when_slots_or_bytes_are_full) {
  Reassembly reassembly;
  const Cut oldest(0, 300, 200);
  reassembly.add(oldest.fragments[0]);
  for (uint32_t i = 1; i <= Reassembly::kSlots; ++i) reassembly.add(Cut(i, 300, 200).fragments[0]);
  EXPECT_EQ(reassembly.given_up(), 1);
  EXPECT_FALSE(reassembly.add(oldest.fragments[1]));
  constexpr size_t kPiece = 65'000;
  const auto before = reassembly.given_up();
  for (uint32_t i = 0; i < 5; ++i) {
    reassembly.add(Cut(1000 + i, kMaxMessage, kPiece).fragments[0]);
  }
  EXPECT_GT(reassembly.given_up(), before) << "5 x 16 MiB do not fit into 64 MiB";
  const Cut fits(2000, 3 * kPiece, kPiece);
  EXPECT_FALSE(reassembly.add(fits.fragments[0]));
  EXPECT_FALSE(reassembly.add(fits.fragments[1]));
  EXPECT_TRUE(reassembly.add(fits.fragments[2])) << "the newest message is complete";
}

TEST(Reassembly, rejects_fragments_that_overlap_or_leave_a_gap) {
  Reassembly reassembly;
  Cut cut(1, 300, 100);
  cut.fragments[1].offset = 50;
  for (const auto& fragment : cut.fragments) EXPECT_FALSE(reassembly.add(fragment));
  EXPECT_EQ(reassembly.inconsistent(), 1);
}

}  // namespace
}  // namespace v3d::bus
