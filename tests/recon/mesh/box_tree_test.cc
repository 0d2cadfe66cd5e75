#include "recon/mesh/box_tree.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "base/geometry/rigid_transform.h"
#include "support/instruction_sets.h"

namespace v3d::recon {
namespace {

using Box = BoxTree::Box;
using Pairs = std::vector<BoxTree::Pair>;

class RandomBoxes {
 public:
  Box next() {
    const Eigen::Vector3f low(unit(), unit(), unit());
    return {low, low + 0.12F * Eigen::Vector3f(unit(), unit(), unit())};
  }
  std::vector<Box> some(size_t count) {
    std::vector<Box> boxes(count);
    for (Box& box : boxes) box = next();
    return boxes;
  }
  bool coin() { return random_() % 2 == 0; }

 private:
  float unit() { return static_cast<float>(random_() % 10'000) / 10'000; }
  std::mt19937 random_{7};
};

/// `chosen`: by number of the box.
Pairs by_trying_all(const std::vector<Box>& boxes, const std::vector<bool>& chosen) {
  Pairs pairs;
  for (uint32_t a = 0; a < boxes.size(); ++a) {
    for (uint32_t b = a + 1; b < boxes.size(); ++b) {
      if ((chosen[a] || chosen[b]) && boxes[a].intersects(boxes[b])) pairs.emplace_back(a, b);
    }
  }
  return pairs;
}

Pairs by_tree(const BoxTree& tree, const std::vector<bool>& chosen) {
  std::vector<BoxTree::Places> places(tree.leaves(), 0);
  for (size_t leaf = 0; leaf < places.size(); ++leaf) {
    const auto numbers = tree.in_leaf(leaf);
    for (size_t i = 0; i < numbers.size(); ++i) {
      if (chosen[numbers[i]]) places[leaf] |= static_cast<BoxTree::Places>(1U << i);
    }
  }
  Pairs pairs;
  for (size_t leaf = 0; leaf < places.size(); ++leaf) tree.overlapping(leaf, places, pairs);
  for (auto& [a, b] : pairs) {
    if (a > b) std::swap(a, b);
  }
  std::sort(pairs.begin(), pairs.end());
  return pairs;
}

TEST(BoxTree, finds_every_pair_that_touches_once_on_every_instruction_set) {
  for (const size_t count : {0, 1, 2, 16, 17, 300, 5000}) {
    const std::vector<Box> boxes = RandomBoxes().some(count);
    const BoxTree tree(boxes);
    const std::vector<bool> all(count, true);
    const Pairs expected = by_trying_all(boxes, all);
    EXPECT_TRUE(count < 300 || expected.size() > count / 10);
    on_every_instruction_set([&] { EXPECT_EQ(by_tree(tree, all), expected) << count << " boxes"; });
  }
}

TEST(BoxTree, omits_pairs_without_a_chosen_box) {
  RandomBoxes random;
  const std::vector<Box> boxes = random.some(1000);
  std::vector<bool> half(boxes.size()), none(boxes.size(), false);
  for (size_t i = 0; i < half.size(); ++i) half[i] = random.coin();
  const BoxTree tree(boxes);
  EXPECT_EQ(by_tree(tree, half), by_trying_all(boxes, half));
  EXPECT_TRUE(by_tree(tree, none).empty());
}

TEST(BoxTree, finds_pairs_of_replaced_boxes) {
  RandomBoxes random;
  std::vector<Box> boxes = random.some(1000);
  BoxTree tree(boxes);
  for (size_t leaf = 0; leaf < tree.leaves(); ++leaf) {
    for (size_t i = 0; i < tree.in_leaf(leaf).size(); ++i) {
      if (random.coin()) tree.replace(leaf, i, boxes[tree.in_leaf(leaf)[i]] = random.next());
    }
  }
  tree.refit();
  const std::vector<bool> all(boxes.size(), true);
  EXPECT_EQ(by_tree(tree, all), by_trying_all(boxes, all));
}

TEST(BoxTree, treats_a_common_corner_as_touching) {
  const Eigen::Vector3f zero(0, 0, 0), one(1, 1, 1), two(2, 2, 2);
  EXPECT_EQ(by_tree(BoxTree(std::vector<Box>{{zero, one}, {one, two}}), {true, true}),
            (Pairs{{0, 1}}));
}

TEST(BoxTree, accepts_boxes_at_one_place_and_nan_corners) {
  const float nan = std::nanf("");
  std::vector<Box> boxes(40, Box(Eigen::Vector3f(1, 1, 1), Eigen::Vector3f(1, 1, 1)));
  EXPECT_EQ(by_tree(BoxTree(boxes), std::vector<bool>(40, true)).size(), 40 * 39 / 2);
  boxes[3] = Box(Eigen::Vector3f(nan, nan, nan), Eigen::Vector3f(nan, nan, nan));
  EXPECT_EQ(by_tree(BoxTree(boxes), std::vector<bool>(40, true)).size(), 39 * 38 / 2);
}

}  // namespace
}  // namespace v3d::recon
