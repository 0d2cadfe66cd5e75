// HashTree: Merkle tree, one hash over many pieces of data in their order.
// Source: RFC 6962, section 2.1, with BLAKE2b of 256 bits (RFC 7693) in place of SHA-256.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace v3d {

using Hash = std::array<uint8_t, 32>;

/// Hash of one piece, which is given in parts: BLAKE2b of a zero byte and the bytes.
class LeafHash {
 public:
  LeafHash();
  ~LeafHash();
  LeafHash(const LeafHash&) = delete;
  LeafHash& operator=(const LeafHash&) = delete;

  void add(std::span<const uint8_t> part);
  /// Ends the piece; call it once.
  Hash value();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// Pieces are added in their order. Takes memory for the logarithm of their number only. One
/// thread.
class HashTree {
 public:
  void add(const Hash& leaf);
  /// Of the pieces so far: two trees have the same root only where all pieces and their order are
  /// the same. Without a piece it is the BLAKE2b of nothing.
  Hash root() const;

 private:
  uint64_t leaves_ = 0;
  std::vector<Hash> subtrees_;  ///< roots of the full subtrees, the largest first
};

/// 64 hexadecimal digits.
std::string hash_text(const Hash& hash);
std::optional<Hash> parse_hash(std::string_view text);

}  // namespace v3d
