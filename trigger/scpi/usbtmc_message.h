// Messages of USBTMC (USB Test and Measurement Class 1.0, section 3): a header of 12 bytes, the
// text, and zeros up to a multiple of 4.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

namespace v3d {

inline constexpr size_t kUsbtmcHeader = 12;

/// DEV_DEP_MSG_OUT with the whole message. `tag` is 1 to 255.
std::vector<uint8_t> usbtmc_out(uint8_t tag, std::string_view text);
/// REQUEST_DEV_DEP_MSG_IN for up to `max_bytes` bytes.
std::vector<uint8_t> usbtmc_request(uint8_t tag, uint32_t max_bytes);

/// The header of a received message and the text of its first transfer.
struct UsbtmcIn {
  uint32_t size = 0;      ///< bytes of text that follow this header, in one or more transfers
  bool end = false;       ///< they are the last ones of the message
  std::string_view text;  ///< the part in this transfer; a view into it
};
/// Parses the first transfer of a DEV_DEP_MSG_IN. Empty when it is not one or has another tag.
std::optional<UsbtmcIn> parse_usbtmc_in(std::span<const uint8_t> transfer, uint8_t tag);

}  // namespace v3d
