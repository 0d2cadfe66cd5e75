// The studio key, and the MAC that it adds to commands and replies. Only holders of the key can
// command the studio. Adapter of libsodium.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string_view>

#include "wire/codec.h"
#include "wire/secret_buffer.h"

namespace v3d {

/// Size of the MAC, bytes. The MAC is the last field (`mac`) of an encoded message:
/// HMAC-SHA-512-256 (crypto_auth of libsodium) of all bytes before it. These start with the type of
/// the message, so the MAC of a reply is not valid for a command.
inline constexpr size_t kCommandMacSize = 32;

/// A secret of 256 bits, the same on every PC of a studio. File format: wire/key_file.h. Copies
/// share one SecretBuffer, which is overwritten when the last copy is destroyed.
class StudioKey {
 public:
  /// Makes a new key from the random generator of the kernel.
  static StudioKey make();
  /// Reads a key file. Throws InputError as load_key_file() does.
  static StudioKey load(const std::filesystem::path& path);
  /// Reads the text of a key file. `path` is used in messages. Throws InputError when the text
  /// holds no key.
  static StudioKey parse(std::string_view text, const std::filesystem::path& path);

  /// Writes a new key file that only its owner may read and write. If the process runs as root and
  /// `group` exists, its members may read the file. Throws InputError when the file exists already
  /// or cannot be written.
  void save(const std::filesystem::path& path, const char* group = "v3d") const;

  /// Sets the MAC of an encoded command or reply.
  void add_mac(Bytes& message) const;
  /// Returns whether the MAC of an encoded message is right, in constant time.
  bool has_valid_mac(std::span<const uint8_t> message) const;

  /// Derives a separate key for another `purpose`: keyed BLAKE2b of that text.
  SecretBuffer derive(std::string_view purpose) const;

  /// Compares in constant time.
  friend bool operator==(const StudioKey& a, const StudioKey& b) {
    return *a.secret_ == *b.secret_;
  }

 private:
  explicit StudioKey(SecretBuffer secret);
  std::shared_ptr<const SecretBuffer> secret_;
};

/// A random number greater than 0 from the random generator of the kernel. It cannot be predicted.
int64_t random_nonce();

/// Returns the encoded message with its MAC.
template <class M>
Bytes encode_with_mac(const M& message, const StudioKey& key) {
  Bytes bytes = encode(message);
  key.add_mac(bytes);
  return bytes;
}

}  // namespace v3d
