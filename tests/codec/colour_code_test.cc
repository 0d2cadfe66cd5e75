#include "codec/colour_code.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <numeric>

#include "codec/entropy_coder.h"

namespace v3d::codec {
namespace {

TEST(RansCoder, needs_the_bits_of_the_slots_of_a_symbol_and_detects_the_end) {
  RansEncoder coder;
  constexpr int kCount = 8000;
  for (int n = 0; n < kCount; ++n) coder.put(kSlots / 2, kSlots / 4);  // 2 bits each
  ByteWriter out;
  coder.finish(out);
  const std::vector<uint8_t> bytes = out.take();
  EXPECT_NEAR(static_cast<double>(bytes.size()), kCount * 2 / 8, 8);
  RansDecoder decoder(bytes);
  for (int n = 0; n < kCount; ++n) {
    ASSERT_FALSE(decoder.ended());
    ASSERT_EQ(decoder.slot() / (kSlots / 4), 2U);
    decoder.take(kSlots / 4, decoder.slot() - kSlots / 2);
  }
  EXPECT_TRUE(decoder.ended());
}

RC_GTEST_PROP(SymbolTable, assigns_all_slots_and_at_least_one_to_every_symbol_that_occurs, ()) {
  SymbolCounts counts{};
  const auto drawn =
      *rc::gen::nonEmpty(rc::gen::container<std::vector<std::pair<uint8_t, uint16_t>>>(
          rc::gen::pair(rc::gen::arbitrary<uint8_t>(), rc::gen::arbitrary<uint16_t>())));
  for (const auto& [symbol, count] : drawn) counts[symbol] = uint32_t{count} + 1;
  const SymbolSlots slots = slots_of(counts);
  RC_ASSERT(std::accumulate(slots.begin(), slots.end(), 0U) == kSlots);
  for (size_t s = 0; s < kSymbols; ++s) RC_ASSERT((slots[s] > 0) == (counts[s] > 0));
  SlotTable table;
  fill(slots, table);
  const SymbolSlots first = first_slots(slots);
  for (uint32_t slot = 0; slot < kSlots; ++slot) {
    const uint32_t symbol = symbol_in(table[slot]);
    RC_ASSERT(first[symbol] + place_in(table[slot]) == slot);
    RC_ASSERT(slots_in(table[slot]) == slots[symbol]);
  }
}

TEST(SymbolTable, is_rejected_with_too_many_or_too_few_slots) {
  for (const uint16_t sum : {kSlots - 1, kSlots, kSlots + 1}) {
    RangeEncoder out;
    SymbolSlots slots{}, decoded{};
    slots[7] = 5;
    slots[200] = static_cast<uint16_t>(sum - 5);
    SlotsModel coding, decoding;
    EXPECT_EQ(coding.code(out, slots), sum == kSlots);
    const std::vector<uint8_t> bytes = out.take();
    RangeDecoder in(bytes);
    EXPECT_EQ(decoding.code(in, decoded), sum == kSlots);
    EXPECT_EQ(decoded, slots);
  }
}

/// Vertices in a row; each is a known vertex of the next two.
KnownVertices strip(uint32_t vertices) {
  std::vector<std::array<uint32_t, 3>> triangles;
  for (uint32_t v = 2; v < vertices; ++v) triangles.push_back({v - 2, v, v - 1});
  KnownVertices known;
  known.make(triangles, vertices);
  return known;
}

LumaChroma drawn_colour() {
  const auto chroma = rc::gen::inRange<int16_t>(-255, 256);
  return {*rc::gen::inRange<int16_t>(0, 256), *chroma, *chroma, 0};
}

RC_GTEST_PROP(ColourCode, keeps_every_colour_within_half_a_step, ()) {
  const auto step = rc::gen::inRange<uint8_t>(1, kMaxColourStep + 1);
  const ColourSteps steps{*step, *step, *step};
  std::vector<LumaChroma> colours(*rc::gen::inRange<size_t>(1, 300));
  for (LumaChroma& colour : colours) colour = drawn_colour();
  const KnownVertices known = strip(static_cast<uint32_t>(colours.size()));
  const CodedColours coded = encode_colours(colours, known, steps, nullptr);
  RC_ASSERT(decode_colours(coded.bytes, known, steps, nullptr) == coded.decoded);
  for (size_t v = 0; v < colours.size(); ++v) {
    for (size_t n = 0; n < 3; ++n) {
      RC_ASSERT(2 * std::abs(coded.decoded[v][n] - colours[v][n]) <= steps[n]);
    }
  }
}

std::vector<LumaChroma> waves(size_t count) {
  std::vector<LumaChroma> colours;
  for (size_t v = 0; v < count; ++v) {
    colours.push_back({static_cast<int16_t>(v * 7 % 256), static_cast<int16_t>(v % 40), 0, 0});
  }
  return colours;
}

TEST(ColourCode, is_rejected_when_truncated_or_extended_or_with_another_vertex_count) {
  constexpr ColourSteps kSteps{4, 4, 4};
  const KnownVertices known = strip(200);
  std::vector<uint8_t> bytes = encode_colours(waves(200), known, kSteps, nullptr).bytes;
  ASSERT_TRUE(decode_colours(bytes, known, kSteps, nullptr));
  for (size_t size = 0; size < bytes.size(); ++size) {
    EXPECT_FALSE(decode_colours(std::span(bytes).first(size), known, kSteps, nullptr)) << size;
  }
  EXPECT_FALSE(decode_colours(bytes, strip(199), kSteps, nullptr));
  EXPECT_FALSE(decode_colours(bytes, strip(201), kSteps, nullptr));
  bytes.push_back(0);
  EXPECT_FALSE(decode_colours(bytes, known, kSteps, nullptr));
}

TEST(ColourCode, is_rejected_when_a_vertex_uses_a_missing_table) {
  RangeEncoder no_tables;
  BitModel model;
  for (int table = 0; table < 19; ++table) no_tables.bit(model, false);
  const std::vector<uint8_t> head = no_tables.take();
  ByteWriter bytes;
  bytes.number(static_cast<uint32_t>(head.size()));
  bytes.bytes(head);
  bytes.number(kRansStart);
  const std::vector<uint8_t> all = bytes.take();
  EXPECT_TRUE(decode_colours(all, strip(0), {1, 1, 1}, nullptr));
  EXPECT_FALSE(decode_colours(all, strip(1), {1, 1, 1}, nullptr));
}

TEST(Reciprocal, divides_exactly_below_2_to_the_63) {
  constexpr uint64_t kEnd = uint64_t{1} << 63;
  for (uint64_t divisor = 1; divisor <= kSlots; ++divisor) {
    const Reciprocal reciprocal(divisor);
    for (const uint64_t multiple : {uint64_t{1}, kRansStart, (kEnd - 1) / divisor}) {
      for (const uint64_t dividend : {multiple * divisor - 1, multiple * divisor, kEnd - 1}) {
        ASSERT_EQ(reciprocal.quotient_of(dividend), dividend / divisor)
            << dividend << " / " << divisor;
      }
    }
  }
}

}  // namespace
}  // namespace v3d::codec
