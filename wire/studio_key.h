// The studio key, and the seal that it puts on commands and their replies: who has the key may
// command the studio, nobody else. The adapter of libsodium.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string_view>

#include "wire/codec.h"
#include "wire/secret_buffer.h"

namespace v3d {

/// The seal is the last field (`mac`) of an encoded message: HMAC-SHA-512-256 (libsodium's
/// crypto_auth) of all bytes before it. The first of these is the message's type, so the seal of a
/// reply is none for a command.
inline constexpr size_t kSealSize = 32;

/// A secret of 256 bits; every PC of a studio has the same. File format: wire/key_file.h. Copies
/// share one SecretBuffer, which is wiped with the last of them.
class StudioKey {
 public:
  /// A new one, from the kernel's random numbers.
  static StudioKey make();
  /// Throws InputError as load_key_file() does.
  static StudioKey load(const std::filesystem::path& path);
  /// `path` names the text in messages.
  static StudioKey parse(std::string_view text, const std::filesystem::path& path);

  /// Writes a file that only its owner may read and write, and, when this is root and there is a
  /// group of that name, the members of `group` may read. Throws InputError when the file exists
  /// already or cannot be written.
  void save(const std::filesystem::path& path, const char* group = "v3d") const;

  /// Fills in the seal of an encoded message that has one.
  void seal(Bytes& message) const;
  /// Takes the same time whatever is wrong with the seal.
  bool has_sealed(std::span<const uint8_t> message) const;

  /// A key of its own for another `purpose`: keyed BLAKE2b of that text.
  SecretBuffer derive(std::string_view purpose) const;

  /// Takes the same time for all keys.
  friend bool operator==(const StudioKey& a, const StudioKey& b) {
    return *a.secret_ == *b.secret_;
  }

 private:
  explicit StudioKey(SecretBuffer secret);
  std::shared_ptr<const SecretBuffer> secret_;
};

/// Above 0, from the kernel's random numbers: nobody can guess it.
int64_t random_nonce();

/// Encoded and sealed.
template <class M>
Bytes encode_sealed(const M& message, const StudioKey& key) {
  Bytes bytes = encode(message);
  key.seal(bytes);
  return bytes;
}

}  // namespace v3d
