#include "common/data_url.h"

#include <sodium.h>

#include <vector>

namespace v3d {

std::string data_url(std::span<const uint8_t> jpeg) {
  constexpr int kVariant = sodium_base64_VARIANT_ORIGINAL;
  std::vector<char> digits(sodium_base64_encoded_len(jpeg.size(), kVariant));
  return "data:image/jpeg;base64," +
         std::string(
             sodium_bin2base64(digits.data(), digits.size(), jpeg.data(), jpeg.size(), kVariant));
}

}  // namespace v3d
