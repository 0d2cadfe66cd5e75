#include <gtest/gtest.h>

#include <set>

#include "wire/signatures.h"

namespace v3d::wire {
namespace {

std::span<const uint8_t> bytes_of(std::string_view text) {
  return {reinterpret_cast<const uint8_t*>(text.data()), text.size()};
}

Hash leaf(std::string_view text) {
  LeafHash hash;
  hash.add(bytes_of(text));
  return hash.value();
}

std::vector<Hash> leaves(size_t count) {
  std::vector<Hash> all;
  for (size_t i = 0; i < count; ++i) all.push_back(leaf(std::to_string(i)));
  return all;
}

Hash tree_root(std::span<const Hash> leaves) {
  HashTree tree;
  for (const Hash& leaf : leaves) tree.add(leaf);
  return tree.root();
}

/// The root as RFC 6962 defines it: split at the largest power of two below the number of leaves.
Hash defined_root(std::span<const Hash> leaves) {
  if (leaves.size() == 1) return leaves.front();
  size_t left = 1;
  while (2 * left < leaves.size()) left *= 2;
  // HashTree does not expose the hash of an inner node; the tree of two leaves computes it.
  const std::array halves{defined_root(leaves.first(left)), defined_root(leaves.subspan(left))};
  return tree_root(halves);
}

TEST(HashTree, has_the_root_that_rfc_6962_defines_for_any_number_of_leaves) {
  for (size_t count = 1; count <= 70; ++count) {
    const std::vector<Hash> all = leaves(count);
    ASSERT_EQ(tree_root(all), defined_root(all)) << count;
  }
}

TEST(HashTree, has_the_hashes_that_b2sum_prints) {
  // printf '' | b2sum -l 256; printf '\0abc' | b2sum -l 256
  EXPECT_EQ(hash_text(HashTree().root()),
            "0e5751c026e543b2e8ab2eb06099daa1d1e5df47778f7787faab45cdf12fe3a8");
  EXPECT_EQ(hash_text(leaf("abc")),
            "4b44b5a5f9e6fafead231e4d609a8e88053a6053c087b68e24e31faf0fb8dfe7");
  const std::array two{leaf("a"), leaf("b")};
  EXPECT_EQ(hash_text(tree_root(two)),
            "ee616625a590167bc4b3dc703ab4f3f2ddecbee6b9d05fee9281f02046e6082e");
}

TEST(HashTree, changes_its_root_with_any_leaf_and_with_order_and_number_of_leaves) {
  const std::vector<Hash> all = leaves(21);
  std::set<Hash> roots{tree_root(all)};
  for (size_t i = 0; i < all.size(); ++i) {
    std::vector<Hash> changed = all;
    changed[i] = leaf("another");
    roots.insert(tree_root(changed));
    if (i == 0) continue;
    changed = all;
    std::swap(changed[i - 1], changed[i]);
    roots.insert(tree_root(changed));
    roots.insert(tree_root(std::span(all).first(i)));
  }
  EXPECT_EQ(roots.size(), 1 + 21 + 20 + 20U);
}

TEST(HashTree, hashes_an_inner_node_differently_from_a_leaf) {
  const std::array two{leaf("a"), leaf("b")};
  std::string inner;
  for (const Hash& hash : two) inner.append(hash.begin(), hash.end());
  EXPECT_NE(tree_root(two), leaf(inner));
}

TEST(LeafHash, does_not_depend_on_the_split_of_a_piece_into_parts) {
  LeafHash parts;
  for (const char* part : {"a", "", "bc"}) parts.add(bytes_of(part));
  EXPECT_EQ(parts.value(), leaf("abc"));
}

TEST(Hash, is_parsed_only_from_64_hexadecimal_digits) {
  const Hash hash = leaf("abc");
  EXPECT_EQ(parse_hash(hash_text(hash)), hash);
  for (const std::string& text : {std::string(), std::string(63, 'a'), std::string(65, 'a'),
                                  std::string(63, 'a') + "g", " " + std::string(63, 'a')}) {
    EXPECT_FALSE(parse_hash(text)) << text;
  }
}

}  // namespace
}  // namespace v3d::wire
