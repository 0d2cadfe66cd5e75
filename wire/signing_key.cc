#include "wire/signing_key.h"

#include <sodium.h>

#include "base/core/check.h"
#include "base/core/error.h"
#include "wire/hexadecimal.h"
#include "wire/key_file.h"

namespace v3d {
namespace {

static_assert(crypto_sign_BYTES == kSignatureSize);
static_assert(crypto_sign_PUBLICKEYBYTES == sizeof(PublicKey::bytes));
static_assert(crypto_sign_SEEDBYTES == kKeySize);
static_assert(crypto_box_SEALBYTES == kSealSize);

using CurvePoint = std::array<uint8_t, crypto_box_PUBLICKEYBYTES>;

/// The X25519 form of a public key; empty when its bytes are no point of Ed25519.
std::optional<CurvePoint> curve_point(const PublicKey& key) {
  CurvePoint point{};
  const bool is_point = crypto_sign_ed25519_pk_to_curve25519(point.data(), key.bytes.data()) == 0;
  return is_point ? std::optional(point) : std::nullopt;
}

}  // namespace

const KeyKind kNodeKey{.name = "signing key",
                       .made_by = "v3dctl key node",
                       .remedy = "make one on each PC with v3dctl key node",
                       .remark =
                           "# The signing key of one V3D node, for its takes and messages. Do not "
                           "copy it to another PC.\n"};
const KeyKind kOperatorKey{
    .name = "operator key",
    .made_by = "v3dctl key operator",
    .remedy =
        "make it with v3dctl key operator, then add it to the member list with v3dctl key enroll",
    .remark = "# The key of one V3D operator. It signs commands.\n"};
const KeyKind kAuthorityKey{
    .name = "authority key",
    .made_by = "v3dctl key authority",
    .remedy = "give its file with --authority; make one with v3dctl key authority",
    .remark =
        "# The key of a V3D studio's authority: it signs the list of members. Do not store it "
        "on a PC of the studio.\n"};

bool PublicKey::has_signed(std::span<const uint8_t> message, const Signature& signature) const {
  return crypto_sign_verify_detached(signature.data(), message.data(), message.size(),
                                     bytes.data()) == 0;
}

bool PublicKey::seal(std::span<const uint8_t> secret, std::span<uint8_t> sealed) const {
  V3D_CHECK(sealed.size() == secret.size() + kSealSize);
  const auto point = curve_point(*this);
  return point && crypto_box_seal(sealed.data(), secret.data(), secret.size(), point->data()) == 0;
}

std::string PublicKey::text() const { return hexadecimal(bytes); }

std::optional<PublicKey> PublicKey::from_text(std::string_view text) {
  PublicKey key;
  if (!parse_hexadecimal(text, key.bytes)) return std::nullopt;
  return key;
}

PublicKey PublicKey::parse(std::string_view text, const std::string& where) {
  if (const auto key = from_text(text)) return *key;
  throw InputError(where +
                   ": expected a public key of 64 hexadecimal digits, as v3dctl key node "
                   "prints");
}

/// The key in the form of libsodium: seed and public key.
class SigningKey::Secret {
 public:
  explicit Secret(const SecretBuffer& seed) {
    crypto_sign_seed_keypair(public_.bytes.data(), bytes_.bytes().data(), seed.data());
  }

  const uint8_t* bytes() const { return bytes_.data(); }
  const PublicKey& public_key() const { return public_; }

 private:
  SecretBuffer bytes_{crypto_sign_SECRETKEYBYTES};
  PublicKey public_;
};

SigningKey::SigningKey(std::shared_ptr<const Secret> secret) : secret_(std::move(secret)) {}

SigningKey SigningKey::make() {
  SecretBuffer seed(kKeySize);
  randombytes_buf(seed.bytes().data(), seed.size());
  return from_seed(seed);
}

SigningKey SigningKey::load(const std::filesystem::path& path, const KeyKind& kind) {
  return from_seed(load_key_file(path, kind));
}

SigningKey SigningKey::from_seed(const SecretBuffer& seed) {
  return SigningKey(std::make_shared<const Secret>(seed));
}

void SigningKey::save(const std::filesystem::path& path, const char* group,
                      const KeyKind& kind) const {
  SecretBuffer seed(kKeySize);
  crypto_sign_ed25519_sk_to_seed(seed.bytes().data(), secret_->bytes());
  save_key_file(path, seed, kind, group);
}

PublicKey SigningKey::public_key() const { return secret_->public_key(); }

Signature SigningKey::sign(std::span<const uint8_t> message) const {
  Signature signature{};
  crypto_sign_detached(signature.data(), nullptr, message.data(), message.size(), secret_->bytes());
  return signature;
}

bool SigningKey::open_sealed(std::span<const uint8_t> sealed, std::span<uint8_t> secret) const {
  V3D_CHECK(sealed.size() == secret.size() + kSealSize);
  const auto point = curve_point(public_key());
  SecretBuffer scalar(crypto_box_SECRETKEYBYTES);
  crypto_sign_ed25519_sk_to_curve25519(scalar.bytes().data(), secret_->bytes());
  return point && crypto_box_seal_open(secret.data(), sealed.data(), sealed.size(), point->data(),
                                       scalar.data()) == 0;
}

}  // namespace v3d
