#include "wire/studio_key.h"

#include <sodium.h>

#include <algorithm>
#include <utility>

#include "base/core/check.h"
#include "wire/key_file.h"

namespace v3d {
namespace {

static_assert(crypto_auth_BYTES == kCommandMacSize);
static_assert(crypto_auth_KEYBYTES == kKeySize);

constexpr KeyKind kKind{
    .name = "studio key",
    .made_by = "v3dctl key new",
    .remedy = "make it once with v3dctl key new, and copy it to every PC of the studio",
    .remark =
        "# The key of a V3D studio. Its holders may command the studio. It is the same on every "
        "PC.\n"};

}  // namespace

StudioKey::StudioKey(SecretBuffer secret)
    : secret_(std::make_shared<const SecretBuffer>(std::move(secret))) {}

StudioKey StudioKey::make() {
  SecretBuffer secret(kKeySize);
  crypto_auth_keygen(secret.bytes().data());
  return StudioKey(std::move(secret));
}

StudioKey StudioKey::load(const std::filesystem::path& path) {
  return StudioKey(load_key_file(path, kKind));
}

StudioKey StudioKey::parse(std::string_view text, const std::filesystem::path& path) {
  return StudioKey(parse_key_file(text, path, kKind));
}

void StudioKey::save(const std::filesystem::path& path, const char* group) const {
  save_key_file(path, *secret_, kKind, group);
}

void StudioKey::add_mac(Bytes& message) const {
  V3D_CHECK(message.size() > kCommandMacSize);
  const size_t size = message.size() - kCommandMacSize;
  crypto_auth(message.data() + size, message.data(), size, secret_->data());
}

bool StudioKey::has_valid_mac(std::span<const uint8_t> message) const {
  if (message.size() <= kCommandMacSize) return false;
  const size_t size = message.size() - kCommandMacSize;
  return crypto_auth_verify(message.data() + size, message.data(), size, secret_->data()) == 0;
}

SecretBuffer StudioKey::derive(std::string_view purpose) const {
  SecretBuffer derived(kKeySize);
  crypto_generichash(derived.bytes().data(), derived.size(),
                     reinterpret_cast<const unsigned char*>(purpose.data()), purpose.size(),
                     secret_->data(), secret_->size());
  return derived;
}

int64_t random_nonce() {
  uint64_t bits = 0;
  randombytes_buf(&bits, sizeof bits);
  return static_cast<int64_t>(std::max<uint64_t>(bits >> 1, 1));
}

}  // namespace v3d
