// Ed25519 signatures (RFC 8032). Each node has its own key and signs the takes that it records.
// Secrets are sealed for a key in its X25519 form. Adapter of libsodium.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "wire/secret_buffer.h"

namespace v3d {

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

/// Secret key of a key pair. File format: wire/key_file.h. Copies share one SecretBuffer, which is
/// overwritten when the last copy is destroyed.
class SigningKey {
 public:
  /// Makes a new key from the random generator of the kernel.
  static SigningKey make();
  /// Reads a key file. Throws InputError with the remedy, as load_key_file() does.
  static SigningKey load(const std::filesystem::path& path, const KeyKind& kind = kNodeKey);

  /// Writes a new file. Throws InputError, as save_key_file() does.
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

}  // namespace v3d
