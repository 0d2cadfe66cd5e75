#include "base/image/mask.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

namespace v3d {
namespace {

/// A mask of random size and random runs.
Mask random_mask() {
  const ImageSize size{*rc::gen::inRange(1, 200), *rc::gen::inRange(1, 40)};
  Mask mask(size);
  for (int y = 0; y < size.height; ++y) {
    const int begin = *rc::gen::inRange(0, size.width + 1);
    mask.fill_row(y, begin, *rc::gen::inRange(begin, size.width + 1));
    mask.set(*rc::gen::inRange(0, size.width), y, *rc::gen::arbitrary<bool>());
  }
  return mask;
}

RC_GTEST_PROP(Mask, run_length_code_keeps_every_bit, ()) {
  const Mask mask = random_mask();
  const auto decoded = decode_runs(encode_runs(mask), mask.size());
  RC_ASSERT(decoded.has_value());
  RC_ASSERT(*decoded == mask);
}

RC_GTEST_PROP(Mask, count_and_bounding_box_match_the_bits, ()) {
  const Mask mask = random_mask();
  int64_t count = 0;
  const Rect box = mask.bounding_box();
  for (int y = 0; y < mask.size().height; ++y) {
    for (int x = 0; x < mask.size().width; ++x) {
      count += mask.get(x, y);
      RC_ASSERT(!mask.get(x, y) || box.contains(x, y));
    }
  }
  RC_ASSERT(mask.count() == count);
  RC_ASSERT(box.empty() == (count == 0));
  // The box is tight: each of its four sides touches foreground.
  if (count > 0) {
    bool left = false, right = false, top = false, bottom = false;
    for (int y = box.y0; y < box.y0 + box.height; ++y) {
      left |= mask.get(box.x0, y);
      right |= mask.get(box.x0 + box.width - 1, y);
    }
    for (int x = box.x0; x < box.x0 + box.width; ++x) {
      top |= mask.get(x, box.y0);
      bottom |= mask.get(x, box.y0 + box.height - 1);
    }
    RC_ASSERT((left && right && top && bottom));
  }
}

RC_GTEST_PROP(Mask, decodes_untrusted_bytes_to_nothing_or_to_a_mask_of_the_given_size,
              (const std::vector<uint8_t>& bytes)) {
  const ImageSize size{*rc::gen::inRange(1, 100), *rc::gen::inRange(1, 100)};
  const auto mask = decode_runs(bytes, size);
  if (mask) {
    RC_ASSERT(mask->size() == size);
    RC_ASSERT(encode_runs(*mask) == bytes);  // the code of a mask is unique
  }
}

TEST(Mask, rejects_runs_that_do_not_fill_the_image) {
  EXPECT_TRUE(decode_runs(std::vector<uint8_t>{12}, {4, 3}));
  EXPECT_FALSE(decode_runs(std::vector<uint8_t>{11}, {4, 3}));
  EXPECT_FALSE(decode_runs(std::vector<uint8_t>{13}, {4, 3}));
  EXPECT_FALSE(decode_runs(std::vector<uint8_t>{12, 0}, {4, 3}));
  EXPECT_FALSE(decode_runs(std::vector<uint8_t>{0x8c}, {4, 3})) << "an unfinished number";
  EXPECT_FALSE(decode_runs(std::vector<uint8_t>{0, 0, 0, 12}, {4, 3})) << "empty runs";
  EXPECT_FALSE(decode_runs(std::vector<uint8_t>{0x8c, 0}, {4, 3})) << "an overlong number";
  EXPECT_FALSE(decode_runs(std::vector<uint8_t>{}, {4, 3}));
  EXPECT_FALSE(decode_runs(std::vector<uint8_t>{0}, {0, 3}));
  EXPECT_FALSE(
      decode_runs(std::vector<uint8_t>{0xff, 0xff, 0xff, 0xff, 0x0f}, {kMaxImageSide + 1, 1}));
}

TEST(Mask, keeps_padding_bits_zero_when_a_row_is_filled_to_its_end) {
  Mask mask({70, 2});
  mask.fill_row(1, 0, 70);
  EXPECT_EQ(mask.count(), 70);
  EXPECT_EQ(mask.row(1)[1], (uint64_t{1} << 6) - 1);
}

TEST(Mask, converts_to_an_8_bit_image_and_back) {
  Mask mask({67, 3});
  mask.fill_row(1, 3, 66);
  EXPECT_EQ(mask_from_image(image_from_mask(mask).view()), mask);
}

TEST(Mask, intersection_over_union_is_0_for_disjoint_and_1_for_equal_or_empty_masks) {
  Mask a({10, 1}), b({10, 1});
  EXPECT_EQ(intersection_over_union(a, b), 1);
  a.fill_row(0, 0, 4);
  b.fill_row(0, 4, 8);
  EXPECT_EQ(intersection_over_union(a, b), 0);
  EXPECT_EQ(intersection_over_union(a, a), 1);
  b.fill_row(0, 0, 8);
  EXPECT_EQ(intersection_over_union(a, b), 0.5);
}

}  // namespace
}  // namespace v3d
