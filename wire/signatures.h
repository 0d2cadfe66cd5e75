// Ed25519 signatures: keys, text files, messages; and the hash tree of signed data.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <tuple>
#include <vector>

#include "base/core/time.h"
#include "wire/codec.h"
#include "wire/secret_keys.h"

namespace v3d::wire {

// Ed25519 signatures (RFC 8032). Each node has its own key and signs the takes that it records.
// Secrets are sealed for a key in its X25519 form. Adapter of libsodium.

inline constexpr size_t kSignatureSize = 64;
using Signature = std::array<uint8_t, kSignatureSize>;
/// Number of bytes by which PublicKey::seal() makes a secret longer.
inline constexpr size_t kSealSize = 48;

/// Public key of a key pair. It verifies signatures.
struct PublicKey {
  std::array<uint8_t, 32> bytes{};

  bool has_signed(std::span<const uint8_t> message, const Signature& signature) const;
  /// Encrypts `secret` so that only the holder of the secret key can open it
  /// (SigningKey::open_sealed). `sealed` is kSealSize longer. False when these bytes are no point
  /// of Ed25519.
  bool seal(std::span<const uint8_t> secret, std::span<uint8_t> sealed) const;
  /// Returns 64 hexadecimal digits.
  std::string text() const;
  /// Empty when `text` is not 64 hexadecimal digits.
  static std::optional<PublicKey> from_text(std::string_view text);
  /// Throws InputError when `text` is not 64 hexadecimal digits. The message starts with `where`.
  static PublicKey parse(std::string_view text, const std::string& where);

  friend bool operator==(const PublicKey&, const PublicKey&) = default;
};

struct KeyKind;
/// Kinds of keys of a studio: for takes and messages of a node, for commands of an operator, and
/// for the member list.
extern const KeyKind kNodeKey, kOperatorKey, kAuthorityKey;

/// Secret key of a key pair. File format: wire/secret_keys.h. Copies share one SecretBuffer, which
/// is overwritten when the last copy is destroyed.
class SigningKey {
 public:
  /// Makes a new key from the random generator of the kernel.
  static SigningKey make();
  /// Reads a key file. Throws InputError with the remedy, as load_key_file() does.
  static SigningKey load(const std::filesystem::path& path, const KeyKind& kind = kNodeKey);

  /// Writes a new file. Throws as save_key_file().
  void save(const std::filesystem::path& path, const char* group = "v3d",
            const KeyKind& kind = kNodeKey) const;

  PublicKey public_key() const;
  Signature sign(std::span<const uint8_t> message) const;
  /// Opens what PublicKey::seal() made for this key. `secret` is kSealSize shorter. False when it
  /// was sealed for another key, or was changed.
  bool open_sealed(std::span<const uint8_t> sealed, std::span<uint8_t> secret) const;

 private:
  class Secret;
  explicit SigningKey(std::shared_ptr<const Secret> secret);
  static SigningKey from_seed(const SecretBuffer& seed);

  std::shared_ptr<const Secret> secret_;
};

// Signed text file. Its first line is the Ed25519 signature of all bytes after that line.

struct SignedText {
  Signature signature{};
  std::string_view text;  ///< the signed text; a view of the text of the file

  bool is_signed_by(const PublicKey& key) const;
};

/// Returns the text of the file: signature = '<128 hexadecimal digits>', a line end, and `text`.
std::string sign_text(std::string_view text, const SigningKey& key);
/// Splits signature and text without verifying. Throws InputError when the first line is no
/// signature. `path` is used in messages.
SignedText split_signed_text(std::string_view file, const std::filesystem::path& path);

// Ed25519 signature that one member of a studio appends to an encoded message.

/// The first bytes of a public key. They identify the key to verify with.
using KeyId = std::array<uint8_t, 8>;
KeyId id_of(const PublicKey& key);
/// The key that signed. Empty: no signature is required, or the key is unknown.
using Signer = std::optional<KeyId>;

/// Size of the signature block, bytes. It follows the message and precedes the trailers of its
/// datagrams: magic "V3DS" (4 bytes), key id (8), signature (64) of all bytes before it. The tools
/// of LCM ignore bytes after a message.
inline constexpr size_t kMessageSignatureSize = 4 + std::tuple_size_v<KeyId> + kSignatureSize;

/// A received message and its signature; views of the received bytes.
struct SignedMessage {
  std::span<const uint8_t> message;
  std::span<const uint8_t> signed_bytes;  ///< message, magic and key id
  KeyId key_id{};
  Signature signature{};

  bool is_signed_by(const PublicKey& key) const;
};

/// Appends the signature. A message starts with its type, so a signature is not valid for a message
/// of another type.
Bytes sign_message(Bytes message, const SigningKey& key);
/// Splits message and signature without verifying it. Empty when no signature follows a message.
std::optional<SignedMessage> split_signature(std::span<const uint8_t> bytes);

/// Channel, session, sequence number and time of a message, as in the trailers of its datagrams
/// (wire/datagram_mac.h).
struct MessageOrigin {
  std::string_view channel;
  uint32_t session = 0;
  uint32_t sequence = 0;   ///< number of the message in its session
  RealtimeInstant sent{};  ///< only whole microseconds are used
};

/// Bytes that a member signs for every message except commands and replies.
///
/// They are the text "V3D message on the bus, version 1" with a newline, then a BLAKE2b-256 hash
/// (LeafHash). The hash covers channel, zero byte, session (4 bytes), sequence (4), `sent` in
/// microseconds (8), message, magic and key id. Integers are big-endian.
///
/// So a signature is valid on one channel, for one message of one session. No other member can send
/// a recorded message again. No command, reply, take or member list starts with this text. The hash
/// comes first because Ed25519 reads a message twice to sign it, and BLAKE2b reads it once.
inline constexpr std::string_view kBusText = "V3D message on the bus, version 1\n";
using BusStatement = std::array<uint8_t, kBusText.size() + 32>;
/// `signed_bytes`: message, magic and key id.
BusStatement bus_statement(std::span<const uint8_t> signed_bytes, const MessageOrigin& origin);
/// Returns the message with its signature, in the layout above.
Bytes sign_on_bus(std::span<const uint8_t> message, const MessageOrigin& origin,
                  const SigningKey& key);

// HashTree: Merkle tree, one hash over a sequence of pieces of data.
// Source: RFC 6962, section 2.1, with BLAKE2b of 256 bits (RFC 7693) instead of SHA-256.

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
