#include "wire/frame_key.h"

#include <sodium.h>

#include <algorithm>

#include "wire/key_file.h"
#include "wire/message_signature.h"

namespace v3d {
namespace {

static_assert(std::tuple_size_v<decltype(SealedFrameKey::sealed)> ==
              kKeySize + crypto_box_SEALBYTES);
static_assert(std::is_same_v<decltype(SealedFrameKey::recipient), KeyId>);

}  // namespace

FrameKey FrameKey::make() {
  SecretBuffer secret(kKeySize);
  randombytes_buf(secret.bytes().data(), secret.size());
  return FrameKey(std::move(secret));
}

std::optional<SealedFrameKey> FrameKey::seal_for(const PublicKey& recipient) const {
  SealedFrameKey sealed;
  if (!recipient.seal(secret_.bytes(), sealed.sealed)) return std::nullopt;
  sealed.recipient = id_of(recipient);
  return sealed;
}

std::optional<FrameKey> FrameKey::open(const SealedFrameKey& sealed, const SigningKey& own) {
  SecretBuffer secret(kKeySize);
  if (!own.open_sealed(sealed.sealed, secret.bytes())) return std::nullopt;
  return FrameKey(std::move(secret));
}

DatagramMac FrameKey::mac() const {
  constexpr std::string_view kPurpose = "v3d frame MAC";
  SecretBuffer derived(kKeySize);
  crypto_generichash(derived.bytes().data(), derived.size(),
                     reinterpret_cast<const unsigned char*>(kPurpose.data()), kPurpose.size(),
                     secret_.data(), secret_.size());
  return DatagramMac(std::move(derived));
}

}  // namespace v3d
