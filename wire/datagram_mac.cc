#include "wire/datagram_mac.h"

#include <sodium.h>

#include <algorithm>
#include <limits>

#include "base/core/bytes.h"
#include "wire/secret_keys.h"
#include "wire/signatures.h"

namespace v3d::wire {
namespace {

constexpr std::array<uint8_t, 4> kMagic = {'V', '3', 'D', '1'};
constexpr int64_t kNsPerUs = 1000;
constexpr size_t kUntaggedSize = kMacTrailerSize - 16;

static_assert(crypto_onetimeauth_BYTES == 16);

// Offsets in the trailer: magic, session (4 bytes), time (8 bytes), tag.
constexpr size_t kSessionAt = kMagic.size();
constexpr size_t kTimeAt = kSessionAt + 4;
constexpr size_t kTagAt = kTimeAt + 8;
static_assert(kTagAt == kUntaggedSize);

/// Key of one datagram: keyed BLAKE2b of the trailer without its tag and of the head. It is on the
/// stack and is overwritten after use: guarded memory for each datagram would cost more than the
/// hash.
class OneTimeKey {
 public:
  OneTimeKey(const SecretBuffer& key, std::span<const uint8_t> head, const MacTrailer& trailer) {
    const std::array<uint8_t, kMacTrailerSize> bytes = trailer.bytes();
    crypto_generichash_state state;
    crypto_generichash_init(&state, key.data(), key.size(), bytes_.size());
    crypto_generichash_update(&state, bytes.data(), kUntaggedSize);
    crypto_generichash_update(&state, head.data(), head.size());
    crypto_generichash_final(&state, bytes_.data(), bytes_.size());  // also overwrites the state
  }
  ~OneTimeKey() { sodium_memzero(bytes_.data(), bytes_.size()); }
  OneTimeKey(const OneTimeKey&) = delete;
  OneTimeKey& operator=(const OneTimeKey&) = delete;

  const uint8_t* data() const { return bytes_.data(); }

 private:
  std::array<uint8_t, crypto_onetimeauth_KEYBYTES> bytes_{};
};

}  // namespace

std::array<uint8_t, kMacTrailerSize> MacTrailer::bytes() const {
  std::array<uint8_t, kMacTrailerSize> bytes{};
  const std::span<uint8_t> all(bytes);
  std::ranges::copy(kMagic, bytes.begin());
  write_big_endian(session, all.subspan(kSessionAt, 4));
  write_big_endian(static_cast<uint64_t>(to_ns(sent) / kNsPerUs), all.subspan(kTimeAt, 8));
  std::ranges::copy(tag, all.subspan(kTagAt).begin());
  return bytes;
}

std::optional<MacTrailer> read_trailer(std::span<const uint8_t, kMacTrailerSize> bytes) {
  if (!std::equal(kMagic.begin(), kMagic.end(), bytes.begin())) return std::nullopt;
  MacTrailer trailer;
  trailer.session = static_cast<uint32_t>(read_big_endian(bytes.subspan<kSessionAt, 4>()));
  const uint64_t sent_us = read_big_endian(bytes.subspan<kTimeAt, 8>());
  if (sent_us > std::numeric_limits<int64_t>::max() / kNsPerUs) return std::nullopt;
  trailer.sent = from_ns<Realtime>(static_cast<int64_t>(sent_us) * kNsPerUs);
  std::ranges::copy(bytes.subspan<kTagAt>(), trailer.tag.begin());
  return trailer;
}

uint32_t random_session() { return randombytes_random(); }

DatagramMac::DatagramMac(const StudioKey& key) : key_(key.derive("v3d datagram MAC")) {}

void DatagramMac::sign(std::span<const uint8_t> head, std::span<const uint8_t> data,
                       MacTrailer& trailer) const {
  const OneTimeKey key(key_, head, trailer);
  crypto_onetimeauth(trailer.tag.data(), data.data(), data.size(), key.data());
}

bool DatagramMac::verify(std::span<const uint8_t> head, std::span<const uint8_t> data,
                         const MacTrailer& trailer) const {
  const OneTimeKey key(key_, head, trailer);
  return crypto_onetimeauth_verify(trailer.tag.data(), data.data(), data.size(), key.data()) == 0;
}

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

}  // namespace v3d::wire
