#include "codec/range_coder.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

namespace v3d {
namespace {

/// A bit is coded with the model of its number, or even.
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

bool comes_back(const std::vector<CodedBit>& bits, std::span<const uint8_t> bytes) {
  RangeDecoder coder(bytes);
  std::array<BitModel, kModels> models;
  for (const auto& [model, bit] : bits) {
    if ((model < kModels ? coder.bit(models[model]) : coder.even_bit()) != bit) return false;
  }
  return coder.ended();
}

RC_GTEST_PROP(RangeCoder, gives_back_every_bit_and_ends_where_the_bytes_end, ()) {
  const auto bits = *rc::gen::container<std::vector<CodedBit>>(
      rc::gen::pair(rc::gen::inRange(0, kModels + 1), rc::gen::arbitrary<bool>()));
  RC_ASSERT(comes_back(bits, encode(bits)));
}

TEST(RangeCoder, carries_through_bytes_that_are_full) {
  // Ones in a model that learnt zeros push low up to just below the next byte again and again.
  for (int zeros = 0; zeros < 300; ++zeros) {
    std::vector<CodedBit> bits(zeros, {0, false});
    for (int n = 0; n < 40; ++n) bits.emplace_back(n % 3, n % 7 != 0);
    EXPECT_TRUE(comes_back(bits, encode(bits))) << zeros;
  }
}

TEST(RangeCoder, codes_a_bit_that_it_has_learnt_in_less_than_a_hundredth) {
  const std::vector<CodedBit> bits(100'000, {0, true});
  EXPECT_LT(encode(bits).size(), 100'000 / 8 / 100U);
  EXPECT_TRUE(comes_back(bits, encode(bits)));
}

TEST(RangeCoder, tells_when_it_was_asked_for_more_than_the_bytes_hold) {
  RangeDecoder coder(std::span<const uint8_t>{});
  for (int n = 0; n < 40; ++n) EXPECT_FALSE(coder.even_bit());
  EXPECT_TRUE(coder.overran());
}

RC_GTEST_PROP(ResidualModel, gives_back_every_number, (const std::vector<int>& drawn)) {
  RangeEncoder out;
  ResidualModel coding;
  std::vector<int> numbers;
  for (const int n : drawn) numbers.push_back(n % (ResidualModel::kMost + 1));
  for (const int number : numbers) coding.code(out, number);
  const std::vector<uint8_t> bytes = out.take();
  RangeDecoder in(bytes);
  ResidualModel decoding;
  for (const int number : numbers) RC_ASSERT(decoding.code(in, 0) == number);
  RC_ASSERT(in.ended());
}

}  // namespace
}  // namespace v3d
