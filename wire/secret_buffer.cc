#include "wire/secret_buffer.h"

#include <sodium.h>

#include <utility>

#include "base/core/error.h"

namespace v3d {
namespace {

uint8_t* allocate(size_t size) {
  // Also chooses libsodium's fastest code; cheap when it is done already.
  if (sodium_init() < 0) throw InputError("libsodium cannot begin");
  auto* const bytes = static_cast<uint8_t*>(sodium_malloc(size));
  if (bytes == nullptr) throw InputError(errno_message("no guarded memory for a key"));
  sodium_memzero(bytes, size);
  return bytes;
}

}  // namespace

SecretBuffer::SecretBuffer(size_t size) : bytes_(allocate(size)), size_(size) {}

SecretBuffer::SecretBuffer(SecretBuffer&& other) noexcept
    : bytes_(std::exchange(other.bytes_, nullptr)), size_(std::exchange(other.size_, 0)) {}

SecretBuffer::~SecretBuffer() { sodium_free(bytes_); }  // wipes

bool operator==(const SecretBuffer& a, const SecretBuffer& b) {
  return a.size_ == b.size_ && sodium_memcmp(a.bytes_, b.bytes_, a.size_) == 0;
}

}  // namespace v3d
