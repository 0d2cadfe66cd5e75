#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include "codec/entropy_coder.h"

namespace v3d::codec {
namespace {

/// A bit with the number of its model; kModels means an even bit.
using CodedBit = std::pair<int, bool>;
constexpr int kModels = 3;

std::vector<uint8_t> encode(const std::vector<CodedBit>& bits) {
  RangeEncoder coder;
  std::array<BitModel, kModels> models;
  for (const auto& [model, bit] : bits) {
    model < kModels ? coder.bit(models[model], bit) : coder.even_bit(bit);
  }
  return coder.take();
}

bool round_trips(const std::vector<CodedBit>& bits, std::span<const uint8_t> bytes) {
  RangeDecoder coder(bytes);
  std::array<BitModel, kModels> models;
  for (const auto& [model, bit] : bits) {
    if ((model < kModels ? coder.bit(models[model]) : coder.even_bit()) != bit) return false;
  }
  return coder.ended();
}

RC_GTEST_PROP(RangeCoder, decodes_every_bit_and_detects_the_end_of_the_bytes, ()) {
  const auto bits = *rc::gen::container<std::vector<CodedBit>>(
      rc::gen::pair(rc::gen::inRange(0, kModels + 1), rc::gen::arbitrary<bool>()));
  RC_ASSERT(round_trips(bits, encode(bits)));
}

TEST(RangeCoder, propagates_carries_through_bytes_of_255) {
  // Ones in a model that adapted to zeros bring low_ repeatedly close to a carry.
  for (int zeros = 0; zeros < 300; ++zeros) {
    std::vector<CodedBit> bits(zeros, {0, false});
    for (int n = 0; n < 40; ++n) bits.emplace_back(n % 3, n % 7 != 0);
    EXPECT_TRUE(round_trips(bits, encode(bits))) << zeros;
  }
}

TEST(RangeCoder, needs_less_than_a_hundredth_of_a_bit_for_a_predictable_bit) {
  const std::vector<CodedBit> bits(100'000, {0, true});
  EXPECT_LT(encode(bits).size(), 100'000 / 8 / 100U);
  EXPECT_TRUE(round_trips(bits, encode(bits)));
}

TEST(RangeCoder, reports_reading_beyond_the_bytes) {
  RangeDecoder coder(std::span<const uint8_t>{});
  for (int n = 0; n < 40; ++n) EXPECT_FALSE(coder.even_bit());
  EXPECT_TRUE(coder.overran());
}

RC_GTEST_PROP(ResidualModel, decodes_every_number, (const std::vector<int>& drawn)) {
  RangeEncoder out;
  ResidualModel coding;
  std::vector<int> numbers;
  for (const int n : drawn) numbers.push_back(n % (ResidualModel::kMaxMagnitude + 1));
  for (const int number : numbers) coding.code(out, number);
  const std::vector<uint8_t> bytes = out.take();
  RangeDecoder in(bytes);
  ResidualModel decoding;
  for (const int number : numbers) RC_ASSERT(decoding.code(in, 0) == number);
  RC_ASSERT(in.ended());
}

}  // namespace
}  // namespace v3d::codec
