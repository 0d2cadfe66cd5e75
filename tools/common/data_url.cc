#include "common/data_url.h"

#include <sodium.h>

#include <vector>

namespace v3d {

std::string base64(std::span<const uint8_t> bytes) {
  constexpr int kVariant = sodium_base64_VARIANT_ORIGINAL;
  std::vector<char> digits(sodium_base64_encoded_len(bytes.size(), kVariant));
  return sodium_bin2base64(digits.data(), digits.size(), bytes.data(), bytes.size(), kVariant);
}

std::string data_url(std::span<const uint8_t> jpeg) {
  return "data:image/jpeg;base64," + base64(jpeg);
}

}  // namespace v3d
