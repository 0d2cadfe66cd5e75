#include "wire/secret_buffer.h"

#include <sodium.h>

#include <utility>

#include "base/core/error.h"

namespace v3d {
namespace {

uint8_t* allocate(size_t size) {
  // Also selects the fastest code of libsodium. A second call costs little.
  if (sodium_init() < 0) throw InputError("cannot initialise libsodium");
  auto* const bytes = static_cast<uint8_t*>(sodium_malloc(size));
  if (bytes == nullptr) throw InputError(errno_message("cannot allocate guarded memory for a key"));
  sodium_memzero(bytes, size);
  return bytes;
}

}  // namespace

SecretBuffer::SecretBuffer(size_t size) : bytes_(allocate(size)), size_(size) {}

SecretBuffer::SecretBuffer(SecretBuffer&& other) noexcept
    : bytes_(std::exchange(other.bytes_, nullptr)), size_(std::exchange(other.size_, 0)) {}

SecretBuffer::~SecretBuffer() { sodium_free(bytes_); }  // overwrites the bytes

bool operator==(const SecretBuffer& a, const SecretBuffer& b) {
  return a.size_ == b.size_ && sodium_memcmp(a.bytes_, b.bytes_, a.size_) == 0;
}

}  // namespace v3d
