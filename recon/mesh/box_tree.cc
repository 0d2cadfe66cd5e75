#include "recon/mesh/box_tree.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "recon/mesh/box_tree.cc"
#include <hwy/foreach_target.h>  // compiles this file once per instruction set
#include <hwy/highway.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <bit>
#include <cstring>
#include <limits>

HWY_BEFORE_NAMESPACE();
namespace v3d::recon::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

#include "recon/simd_float.inc"

using Box = BoxTree::Box;
using Node = BoxTree::Node;
using Levels = std::vector<std::vector<Node>>;
using Places = uint32_t;  ///< wider than BoxTree::Places, for arithmetic

static_assert(BoxTree::kWidth % kLanes == 0);

/// The places of a node whose boxes overlap the given box.
HWY_INLINE Places touched(const Node& node, const Box& box) {
  const Floats floats;
  Places places = 0;
  for (size_t i = 0; i < BoxTree::kWidth; i += kLanes) {
    const auto along = [&](int a) {
      const auto low = hn::Load(floats, &node.low[a][i]);
      const auto high = hn::Load(floats, &node.high[a][i]);
      return hn::And(hn::Le(low, hn::Set(floats, box.max()[a])),
                     hn::Ge(high, hn::Set(floats, box.min()[a])));
    };
    const auto all = hn::And(along(0), hn::And(along(1), along(2)));
    places |= static_cast<Places>(bits_of(all)) << i;
  }
  return places;
}

/// Query of one leaf.
class Search {
 public:
  Search(const Levels& levels, const uint32_t* order, const BoxTree::Places* chosen, size_t leaf,
         std::vector<BoxTree::Pair>& pairs)
      : levels_(levels),
        order_(order),
        chosen_(chosen),
        leaf_(leaf),
        mine_(levels[0][leaf]),
        pairs_(pairs) {
    for (Places places = chosen_[leaf_]; places != 0; places &= places - 1) {
      around_.extend(mine_.at(std::countr_zero(places)));
    }
  }

  void descend(size_t level, size_t number) {
    const Node& node = levels_[level][number];
    for (Places places = touched(node, around_); places != 0; places &= places - 1) {
      const int place = std::countr_zero(places);
      const size_t below = number * BoxTree::kWidth + place;
      if (level > 1) {
        descend(level - 1, below);
      } else {
        compare_with(below, node.at(place));
      }
    }
  }

 private:
  void compare_with(size_t other, const Box& around_other) {
    // If both boxes of a pair are chosen, only the leaf with the lower index reports the pair.
    const Places others = other > leaf_ ? ~Places{0} : ~Places{chosen_[other]};
    const Node& theirs = levels_[0][other];
    Places queries = touched(mine_, around_other) & chosen_[leaf_];
    for (; queries != 0; queries &= queries - 1) {
      const int i = std::countr_zero(queries);
      const Places wanted = other == leaf_ ? others | ~Places{1} << i : others;
      Places found = touched(theirs, mine_.at(i)) & wanted;
      for (; found != 0; found &= found - 1) {
        pairs_.emplace_back(order_[leaf_ * BoxTree::kWidth + i],
                            order_[other * BoxTree::kWidth + std::countr_zero(found)]);
      }
    }
  }

  const Levels& levels_;
  const uint32_t* order_;
  const BoxTree::Places* chosen_;
  const size_t leaf_;
  const Node& mine_;
  std::vector<BoxTree::Pair>& pairs_;
  Box around_;  ///< bounding box of the chosen boxes
};

void search_any(const Levels& levels, const uint32_t* order, const BoxTree::Places* chosen,
                size_t leaf, std::vector<BoxTree::Pair>& pairs) {
  Search(levels, order, chosen, leaf, pairs).descend(levels.size() - 1, 0);
}

}  // namespace
}  // namespace v3d::recon::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace v3d::recon {
namespace {

constexpr int kBitsOfAxis = 10;  ///< per axis in a Morton code
constexpr float kEmptyLow = std::numeric_limits<float>::infinity();

/// Inserts two zeros above each of the lowest ten bits.
uint32_t spread(uint32_t bits) {
  bits = (bits | bits << 16) & 0x030000FF;
  bits = (bits | bits << 8) & 0x0300F00F;
  bits = (bits | bits << 4) & 0x030C30C3;
  return (bits | bits << 2) & 0x09249249;
}

/// Morton codes of the box centres. Boxes with similar codes are close to each other.
std::vector<uint32_t> places_on_curve(std::span<const BoxTree::Box> boxes) {
  BoxTree::Box all;
  for (const BoxTree::Box& box : boxes) all.extend(box);
  constexpr float kLast = (1 << kBitsOfAxis) - 1;
  const Eigen::Vector3f first = 2 * all.min();  // of twice the box centres
  const Eigen::Array3f scale = kLast / (2 * all.sizes().array());
  std::vector<uint32_t> places(boxes.size());
  tbb::parallel_for(size_t{0}, boxes.size(), [&](size_t b) {
    const Eigen::Array3f at = (boxes[b].min() + boxes[b].max() - first).array() * scale;
    // `at` is NaN where all boxes lie in one plane or a corner is NaN; NaN becomes 0.
    const auto axis = [&](int a) { return at[a] > 0 ? std::min(at[a], kLast) : 0.0F; };
    places[b] = spread(static_cast<uint32_t>(axis(0))) |
                spread(static_cast<uint32_t>(axis(1))) << 1 |
                spread(static_cast<uint32_t>(axis(2))) << 2;
  });
  return places;
}

/// Indices that sort the keys in ascending order: radix sort of 3 * kBitsOfAxis bits, kBitsOfAxis
/// at a time.
std::vector<uint32_t> sorted_numbers(const std::vector<uint32_t>& keys) {
  constexpr uint32_t kDigits = 1 << kBitsOfAxis;
  std::vector<uint32_t> numbers(keys.size()), next(keys.size());
  for (uint32_t i = 0; i < numbers.size(); ++i) numbers[i] = i;
  for (int shift = 0; shift < 3 * kBitsOfAxis; shift += kBitsOfAxis) {
    const auto digit = [&](uint32_t number) { return keys[number] >> shift & (kDigits - 1); };
    std::array<uint32_t, kDigits + 1> first{};
    for (const uint32_t number : numbers) ++first[digit(number) + 1];
    for (size_t d = 1; d < first.size(); ++d) first[d] += first[d - 1];
    for (const uint32_t number : numbers) next[first[digit(number)]++] = number;
    numbers.swap(next);
  }
  return numbers;
}

}  // namespace

BoxTree::Node::Node() {
  for (auto& side : low) side.fill(kEmptyLow);
  for (auto& side : high) side.fill(-kEmptyLow);
}

BoxTree::BoxTree(std::span<const Box> boxes) : order_(sorted_numbers(places_on_curve(boxes))) {
  levels_.emplace_back(leaves());
  do {
    levels_.emplace_back((levels_.back().size() + kWidth - 1) / kWidth);
  } while (levels_.back().size() > 1);
  tbb::parallel_for(size_t{0}, leaves(), [&](size_t leaf) {
    const auto numbers = in_leaf(leaf);
    for (size_t place = 0; place < numbers.size(); ++place) {
      replace(leaf, place, boxes[numbers[place]]);
    }
  });
  refit();
}

std::span<const uint32_t> BoxTree::in_leaf(size_t leaf) const {
  return std::span(order_).subspan(leaf * kWidth, std::min(kWidth, order_.size() - leaf * kWidth));
}

void BoxTree::refit() {
  for (size_t level = 1; level < levels_.size(); ++level) {
    const std::vector<Node>& below = levels_[level - 1];
    tbb::parallel_for(size_t{0}, levels_[level].size(), [&](size_t n) {
      const size_t end = std::min(below.size(), (n + 1) * kWidth);
      for (size_t child = n * kWidth; child < end; ++child) {
        Box all;
        for (size_t place = 0; place < kWidth; ++place) all.extend(below[child].at(place));
        levels_[level][n].set(child - n * kWidth, all);
      }
    });
  }
}

HWY_EXPORT(search_any);

void BoxTree::overlapping(size_t leaf, std::span<const Places> chosen,
                          std::vector<Pair>& pairs) const {
  HWY_DYNAMIC_DISPATCH(search_any)(levels_, order_.data(), chosen.data(), leaf, pairs);
}

}  // namespace v3d::recon
#endif
