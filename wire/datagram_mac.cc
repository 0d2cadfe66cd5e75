#include "wire/datagram_mac.h"

#include <sodium.h>

#include <algorithm>
#include <limits>

namespace v3d {
namespace {

constexpr std::array<uint8_t, 4> kMagic = {'V', '3', 'D', '1'};
constexpr int64_t kNsPerUs = 1000;
constexpr size_t kUntaggedSize = kMacTrailerSize - 16;

static_assert(crypto_onetimeauth_BYTES == 16);

template <class Integer>
void write_integer(uint8_t*& at, Integer value) {
  for (int shift = 8 * (sizeof value - 1); shift >= 0; shift -= 8) {
    *at++ = static_cast<uint8_t>(value >> shift);
  }
}

template <class Integer>
Integer read_integer(const uint8_t*& at) {
  Integer value = 0;
  for (size_t i = 0; i < sizeof value; ++i) value = static_cast<Integer>(value << 8 | *at++);
  return value;
}

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
  uint8_t* at = std::copy(kMagic.begin(), kMagic.end(), bytes.data());
  write_integer(at, session);
  write_integer(at, static_cast<uint64_t>(to_ns(sent) / kNsPerUs));
  std::copy(tag.begin(), tag.end(), at);
  return bytes;
}

std::optional<MacTrailer> read_trailer(std::span<const uint8_t, kMacTrailerSize> bytes) {
  if (!std::equal(kMagic.begin(), kMagic.end(), bytes.begin())) return std::nullopt;
  const uint8_t* at = bytes.data() + kMagic.size();
  MacTrailer trailer;
  trailer.session = read_integer<uint32_t>(at);
  const auto sent_us = read_integer<uint64_t>(at);
  if (sent_us > std::numeric_limits<int64_t>::max() / kNsPerUs) return std::nullopt;
  trailer.sent = from_ns<Realtime>(static_cast<int64_t>(sent_us) * kNsPerUs);
  std::copy_n(at, trailer.tag.size(), trailer.tag.begin());
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

}  // namespace v3d
