#include "wire/message_signature.h"

#include <algorithm>

#include "wire/hash_tree.h"

namespace v3d {
namespace {

constexpr std::array<uint8_t, 4> kMagic = {'V', '3', 'D', 'S'};

void append_key_id(Bytes& message, const PublicKey& key) {
  const KeyId id = id_of(key);
  message.insert(message.end(), kMagic.begin(), kMagic.end());
  message.insert(message.end(), id.begin(), id.end());
}

/// Channel, zero byte, session, sequence and time.
Bytes bytes_of(const MessageOrigin& origin) {
  Bytes bytes(origin.channel.begin(), origin.channel.end());
  bytes.push_back(0);
  const auto put = [&](uint64_t number, int size) {
    for (int i = size - 1; i >= 0; --i) bytes.push_back(static_cast<uint8_t>(number >> 8 * i));
  };
  put(origin.session, 4);
  put(origin.sequence, 4);
  put(static_cast<uint64_t>(to_ns(origin.sent) / 1000), 8);
  return bytes;
}

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
  message.reserve(message.size() + kMessageSignatureSize);
  append_key_id(message, key.public_key());
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

BusStatement bus_statement(std::span<const uint8_t> signed_bytes, const MessageOrigin& origin) {
  LeafHash hash;
  hash.add(bytes_of(origin));
  hash.add(signed_bytes);
  BusStatement statement{};
  const auto end = std::ranges::copy(kBusText, statement.begin()).out;
  std::ranges::copy(hash.value(), end);
  return statement;
}

Bytes sign_on_bus(std::span<const uint8_t> message, const MessageOrigin& origin,
                  const SigningKey& key) {
  Bytes bytes;
  bytes.reserve(message.size() + kMessageSignatureSize);
  bytes.assign(message.begin(), message.end());
  append_key_id(bytes, key.public_key());
  const Signature signature = key.sign(bus_statement(bytes, origin));
  bytes.insert(bytes.end(), signature.begin(), signature.end());
  return bytes;
}

}  // namespace v3d
