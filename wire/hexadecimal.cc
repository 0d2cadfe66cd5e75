#include "wire/hexadecimal.h"

#include <sodium.h>

#include "base/core/check.h"

namespace v3d {

std::string hexadecimal(std::span<const uint8_t> bytes) {
  std::string text(2 * bytes.size() + 1, '\0');
  sodium_bin2hex(text.data(), text.size(), bytes.data(), bytes.size());
  text.pop_back();
  return text;
}

void write_hexadecimal(std::span<const uint8_t> bytes, std::span<uint8_t> digits) {
  V3D_CHECK(digits.size() == 2 * bytes.size() + 1);
  sodium_bin2hex(reinterpret_cast<char*>(digits.data()), digits.size(), bytes.data(), bytes.size());
}

bool parse_hexadecimal(std::string_view text, std::span<uint8_t> bytes) {
  size_t size = 0;
  return text.size() == 2 * bytes.size() &&
         sodium_hex2bin(bytes.data(), bytes.size(), text.data(), text.size(), nullptr, &size,
                        nullptr) == 0 &&
         size == bytes.size();
}

}  // namespace v3d
