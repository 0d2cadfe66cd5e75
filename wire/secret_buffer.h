// Memory for secrets: keys, and the text of the files that hold them. The adapter of libsodium.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

namespace v3d {

/// A fixed number of secret bytes, at first zeros. They lie in pages of their own, between guard
/// pages, locked against swapping where the limit of the process permits it (RLIMIT_MEMLOCK), and
/// are left out of core dumps. The destructor wipes them. Moves copy no byte; a buffer that was
/// moved from is empty. One thread writes; afterwards any thread reads.
class SecretBuffer {
 public:
  /// Throws InputError when the system gives no such memory.
  explicit SecretBuffer(size_t size);
  SecretBuffer(SecretBuffer&& other) noexcept;
  SecretBuffer& operator=(SecretBuffer&&) = delete;
  ~SecretBuffer();

  std::span<uint8_t> bytes() { return {bytes_, size_}; }
  std::span<const uint8_t> bytes() const { return {bytes_, size_}; }
  const uint8_t* data() const { return bytes_; }
  size_t size() const { return size_; }
  std::string_view text() const { return {reinterpret_cast<const char*>(bytes_), size_}; }

  /// Takes the same time for all contents of one size.
  friend bool operator==(const SecretBuffer& a, const SecretBuffer& b);

 private:
  uint8_t* bytes_;
  size_t size_;
};

}  // namespace v3d
