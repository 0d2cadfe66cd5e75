// Memory for secrets: keys and the text of key files. Adapter of libsodium.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

namespace v3d {

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

}  // namespace v3d
