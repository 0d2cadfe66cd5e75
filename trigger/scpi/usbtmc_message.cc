#include "trigger/scpi/usbtmc_message.h"

#include <algorithm>

namespace v3d {
namespace {

constexpr uint8_t kMessageOut = 1;
constexpr uint8_t kMessageIn = 2;  // request and answer
constexpr uint8_t kEndOfMessage = 1;

/// A header, followed by `body` zero bytes.
std::vector<uint8_t> message(uint8_t kind, uint8_t tag, size_t size, uint8_t attributes,
                             size_t body) {
  std::vector<uint8_t> bytes(kUsbtmcHeader + body, 0);
  bytes[0] = kind;
  bytes[1] = tag;
  bytes[2] = static_cast<uint8_t>(~tag);
  for (size_t i = 0; i < 4; ++i) bytes[4 + i] = static_cast<uint8_t>(size >> (8 * i));
  bytes[8] = attributes;
  return bytes;
}

}  // namespace

std::vector<uint8_t> usbtmc_out(uint8_t tag, std::string_view text) {
  const size_t padded = (text.size() + 3) / 4 * 4;
  std::vector<uint8_t> bytes = message(kMessageOut, tag, text.size(), kEndOfMessage, padded);
  std::copy(text.begin(), text.end(), bytes.begin() + kUsbtmcHeader);
  return bytes;
}

std::vector<uint8_t> usbtmc_request(uint8_t tag, uint32_t max_bytes) {
  return message(kMessageIn, tag, max_bytes, 0, 0);
}

std::optional<UsbtmcIn> parse_usbtmc_in(std::span<const uint8_t> transfer, uint8_t tag) {
  if (transfer.size() < kUsbtmcHeader || transfer[0] != kMessageIn || transfer[1] != tag ||
      transfer[2] != static_cast<uint8_t>(~tag)) {
    return {};
  }
  UsbtmcIn in;
  for (size_t i = 0; i < 4; ++i) in.size |= static_cast<uint32_t>(transfer[4 + i]) << (8 * i);
  in.end = (transfer[8] & kEndOfMessage) != 0;
  const auto text = transfer.subspan(kUsbtmcHeader);
  in.text = {reinterpret_cast<const char*>(text.data()), std::min<size_t>(text.size(), in.size)};
  return in;
}

}  // namespace v3d
