// Secrets: memory, digits, files, the studio key.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "wire/codec.h"

namespace v3d::wire {

// Memory for secrets: keys and the text of key files. Adapter of libsodium.

/// A fixed number of secret bytes, initially zero.
///
/// They lie in separate pages between guard pages and are excluded from core dumps. They are locked
/// against swapping if the limit of the process permits it (RLIMIT_MEMLOCK). The destructor
/// overwrites them. A move copies no byte and leaves the source empty. One thread writes;
/// afterwards any thread reads.
class SecretBuffer {
 public:
  /// `size`: bytes. Throws InputError when the system cannot provide such memory.
  explicit SecretBuffer(size_t size);
  SecretBuffer(SecretBuffer&& other) noexcept;
  SecretBuffer& operator=(SecretBuffer&&) = delete;
  ~SecretBuffer();

  std::span<uint8_t> bytes() { return {bytes_, size_}; }
  std::span<const uint8_t> bytes() const { return {bytes_, size_}; }
  const uint8_t* data() const { return bytes_; }
  size_t size() const { return size_; }
  std::string_view text() const { return {reinterpret_cast<const char*>(bytes_), size_}; }

  /// Compares in constant time for a given size.
  friend bool operator==(const SecretBuffer& a, const SecretBuffer& b);

 private:
  uint8_t* bytes_;
  size_t size_;
};

// Conversion of bytes to hexadecimal digits and back. Adapter of the conversions of libsodium,
// which take constant time for a given length.

/// Two lower-case digits for each byte.
std::string hexadecimal(std::span<const uint8_t> bytes);
/// The same for secrets, into memory of the caller. `digits` has two places for each byte and one
/// more, which becomes 0.
void write_hexadecimal(std::span<const uint8_t> bytes, std::span<uint8_t> digits);

/// Fills `bytes`. False when `text` does not have exactly two digits for each byte.
[[nodiscard]] bool parse_hexadecimal(std::string_view text, std::span<uint8_t> bytes);

// Files of secret keys: one line of 64 hexadecimal digits. Lines that start with '#' are comments.

inline constexpr size_t kKeySize = 32;  ///< bytes

/// Texts for messages about one kind of key.
struct KeyKind {
  std::string_view name;     ///< "studio key"
  std::string_view made_by;  ///< "v3dctl key new"
  std::string_view remedy;   ///< how to get one, for the message about a missing file
  std::string_view remark;   ///< comment in the first line of a new file, with '#' and line end
};

/// Reads a key file. Leaves no copy of the key or of the text in memory.
///
/// Throws InputError with the remedy when the file does not exist, is longer than 4 KiB or holds no
/// key. It also throws when others than owner and group may read the file, or others than the owner
/// may write it.
SecretBuffer load_key_file(const std::filesystem::path& path, const KeyKind& kind);
/// The same for the text of a key file. `path` is used in messages.
SecretBuffer parse_key_file(std::string_view text, const std::filesystem::path& path,
                            const KeyKind& kind);

/// Writes a new key file that only its owner may read and write. If the process runs as root and
/// `group` exists, its members may read it. On return, file and name are on the disk. Throws like
/// io::throw_creation_error(), and std::runtime_error for errors of the disk; then it is removed.
void save_key_file(const std::filesystem::path& path, const SecretBuffer& key, const KeyKind& kind,
                   const char* group);

// The studio key, and the MAC that it adds to commands and replies. Only holders of the key can
// command the studio. Adapter of libsodium.

/// Size of the MAC, bytes. The MAC is the last field (`mac`) of an encoded message:
/// HMAC-SHA-512-256 (crypto_auth of libsodium) of all bytes before it. These start with the type of
/// the message, so the MAC of a reply is not valid for a command.
inline constexpr size_t kCommandMacSize = 32;

/// A secret of 256 bits, the same on every PC of a studio. The text of its file: see above. Copies
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
  /// `group` exists, its members may read the file. Throws InputError when the file exists already,
  /// and otherwise as save_key_file().
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

}  // namespace v3d::wire
