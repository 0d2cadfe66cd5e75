#include "wire/hash_tree.h"

#include <sodium.h>

#include "wire/secret_keys.h"

namespace v3d::wire {
namespace {

constexpr std::array<uint8_t, 1> kLeaf{0}, kInner{1};

Hash parent_hash(const Hash& left, const Hash& right) {
  crypto_generichash_state state;
  crypto_generichash_init(&state, nullptr, 0, sizeof(Hash));
  crypto_generichash_update(&state, kInner.data(), kInner.size());
  crypto_generichash_update(&state, left.data(), left.size());
  crypto_generichash_update(&state, right.data(), right.size());
  Hash result{};
  crypto_generichash_final(&state, result.data(), result.size());
  return result;
}

}  // namespace

struct LeafHash::State {
  crypto_generichash_state blake2b;
};

LeafHash::LeafHash() : state_(std::make_unique<State>()) {
  crypto_generichash_init(&state_->blake2b, nullptr, 0, sizeof(Hash));
  add(kLeaf);
}
LeafHash::~LeafHash() = default;

void LeafHash::add(std::span<const uint8_t> part) {
  crypto_generichash_update(&state_->blake2b, part.data(), part.size());
}

Hash LeafHash::value() {
  Hash result{};
  crypto_generichash_final(&state_->blake2b, result.data(), result.size());
  return result;
}

void HashTree::add(const Hash& leaf) {
  subtrees_.push_back(leaf);
  // Each 1 bit at the low end of the count is one pair of full subtrees of equal size to merge.
  for (uint64_t n = leaves_++; (n & 1) != 0; n >>= 1) {
    const Hash right = subtrees_.back();
    subtrees_.pop_back();
    subtrees_.back() = parent_hash(subtrees_.back(), right);
  }
}

Hash HashTree::root() const {
  if (subtrees_.empty()) {
    Hash empty{};
    crypto_generichash(empty.data(), empty.size(), nullptr, 0, nullptr, 0);
    return empty;
  }
  Hash root = subtrees_.back();
  for (size_t i = subtrees_.size() - 1; i-- > 0;) root = parent_hash(subtrees_[i], root);
  return root;
}

std::string hash_text(const Hash& hash) { return hexadecimal(hash); }

std::optional<Hash> parse_hash(std::string_view text) {
  Hash hash{};
  if (!parse_hexadecimal(text, hash)) return std::nullopt;
  return hash;
}

}  // namespace v3d::wire
