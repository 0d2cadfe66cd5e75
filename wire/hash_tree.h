// HashTree: Merkle tree, one hash over a sequence of pieces of data.
// Source: RFC 6962, section 2.1, with BLAKE2b of 256 bits (RFC 7693) instead of SHA-256.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace v3d::wire {

using Hash = std::array<uint8_t, 32>;

/// Leaf of the tree: BLAKE2b hash of a zero byte and the bytes of one piece. The piece may be added
/// in several parts.
class LeafHash {
 public:
  LeafHash();
  ~LeafHash();
  LeafHash(const LeafHash&) = delete;
  LeafHash& operator=(const LeafHash&) = delete;

  void add(std::span<const uint8_t> part);
  /// Finishes the hash. Call it once.
  Hash value();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// Incremental Merkle tree. Pieces are added in order. Memory grows with the logarithm of their
/// number. One thread.
class HashTree {
 public:
  void add(const Hash& leaf);
  /// Root hash of the pieces so far. Two trees have the same root only if all pieces and their
  /// order are the same. Without pieces it is the BLAKE2b hash of no bytes.
  Hash root() const;

 private:
  uint64_t leaves_ = 0;
  std::vector<Hash> subtrees_;  ///< roots of the full subtrees, largest first
};

/// Converts a hash to 64 hexadecimal digits.
std::string hash_text(const Hash& hash);
/// Empty when `text` is not 64 hexadecimal digits.
std::optional<Hash> parse_hash(std::string_view text);

}  // namespace v3d::wire
