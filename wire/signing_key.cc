#include "wire/signing_key.h"

#include <sodium.h>

#include "base/error.h"
#include "wire/hexadecimal.h"
#include "wire/key_file.h"

namespace v3d {
namespace {

static_assert(crypto_sign_BYTES == kSignatureSize);
static_assert(crypto_sign_PUBLICKEYBYTES == sizeof(PublicKey::bytes));
static_assert(crypto_sign_SEEDBYTES == sizeof(KeyBytes));

constexpr KeyKind kKind{
    .name = "signing key",
    .made_by = "v3dctl key node",
    .remedy = "make one on each PC with v3dctl key node",
    .remark = "# The signing key of one V3D node: takes are signed with it. Of this PC alone.\n"};

}  // namespace

bool PublicKey::has_signed(std::span<const uint8_t> message, const Signature& signature) const {
  return crypto_sign_verify_detached(signature.data(), message.data(), message.size(),
                                     bytes.data()) == 0;
}

std::string PublicKey::text() const { return hexadecimal(bytes); }

PublicKey PublicKey::parse(std::string_view text, const std::string& where) {
  PublicKey key;
  if (parse_hexadecimal(text, key.bytes)) return key;
  throw InputError(where +
                   ": expected a public key of 64 hexadecimal digits, as v3dctl key node "
                   "prints");
}

/// libsodium's form of the key: seed and public key.
class SigningKey::Secret {
 public:
  explicit Secret(const KeyBytes& seed) {
    if (bytes_ == nullptr) throw InputError("no locked memory for the signing key");
    crypto_sign_seed_keypair(public_.bytes.data(), bytes_, seed.data());
  }
  ~Secret() { sodium_free(bytes_); }  // wipes
  Secret(const Secret&) = delete;
  Secret& operator=(const Secret&) = delete;

  const uint8_t* bytes() const { return bytes_; }
  const PublicKey& public_key() const { return public_; }

 private:
  uint8_t* const bytes_ = static_cast<uint8_t*>(sodium_malloc(crypto_sign_SECRETKEYBYTES));
  PublicKey public_;
};

SigningKey::SigningKey(std::shared_ptr<const Secret> secret) : secret_(std::move(secret)) {}

SigningKey SigningKey::make() {
  KeyBytes seed{};
  randombytes_buf(seed.data(), seed.size());
  SigningKey key = from_seed(seed);
  sodium_memzero(seed.data(), seed.size());
  return key;
}

SigningKey SigningKey::load(const std::filesystem::path& path) {
  KeyBytes seed = load_key_file(path, kKind);
  SigningKey key = from_seed(seed);
  sodium_memzero(seed.data(), seed.size());
  return key;
}

SigningKey SigningKey::from_seed(const KeyBytes& seed) {
  if (sodium_init() < 0) throw InputError("libsodium cannot begin");
  return SigningKey(std::make_shared<const Secret>(seed));
}

void SigningKey::save(const std::filesystem::path& path, const char* group) const {
  KeyBytes seed{};
  crypto_sign_ed25519_sk_to_seed(seed.data(), secret_->bytes());
  save_key_file(path, seed, kKind, group);
  sodium_memzero(seed.data(), seed.size());
}

PublicKey SigningKey::public_key() const { return secret_->public_key(); }

Signature SigningKey::sign(std::span<const uint8_t> message) const {
  Signature signature{};
  crypto_sign_detached(signature.data(), nullptr, message.data(), message.size(), secret_->bytes());
  return signature;
}

}  // namespace v3d
