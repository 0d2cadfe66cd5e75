#include "wire/message_signature.h"

#include <algorithm>

namespace v3d {
namespace {

constexpr std::array<uint8_t, 4> kMagic = {'V', '3', 'D', 'S'};

}  // namespace

KeyId id_of(const PublicKey& key) {
  KeyId id{};
  std::copy_n(key.bytes.begin(), id.size(), id.begin());
  return id;
}

bool SignedMessage::is_signed_by(const PublicKey& key) const {
  return id_of(key) == key_id && key.has_signed(signed_bytes, signature);
}

Bytes sign_message(Bytes message, const SigningKey& key) {
  const KeyId id = id_of(key.public_key());
  message.reserve(message.size() + kMessageSignatureSize);
  message.insert(message.end(), kMagic.begin(), kMagic.end());
  message.insert(message.end(), id.begin(), id.end());
  const Signature signature = key.sign(message);
  message.insert(message.end(), signature.begin(), signature.end());
  return message;
}

std::optional<SignedMessage> split_signature(std::span<const uint8_t> bytes) {
  if (bytes.size() <= kMessageSignatureSize) return std::nullopt;
  const size_t size = bytes.size() - kMessageSignatureSize;
  const auto magic = bytes.subspan(size, kMagic.size());
  if (!std::ranges::equal(magic, kMagic)) return std::nullopt;
  SignedMessage split;
  split.message = bytes.first(size);
  split.signed_bytes = bytes.first(bytes.size() - kSignatureSize);
  std::ranges::copy(split.signed_bytes.last(split.key_id.size()), split.key_id.begin());
  std::ranges::copy(bytes.last(kSignatureSize), split.signature.begin());
  return split;
}

}  // namespace v3d
