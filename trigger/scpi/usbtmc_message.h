// USBTMC on the wire (USB Test and Measurement Class 1.0, section 3): a header of 12 bytes, the
// text, zeros up to a multiple of 4.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

namespace v3d {

inline constexpr size_t kUsbtmcHeader = 12;

/// DEV_DEP_MSG_OUT with the whole message in it. `tag` is 1 to 255.
std::vector<uint8_t> usbtmc_out(uint8_t tag, std::string_view text);
/// REQUEST_DEV_DEP_MSG_IN for up to `most` bytes.
std::vector<uint8_t> usbtmc_request(uint8_t tag, uint32_t most);

struct UsbtmcIn {
  uint32_t size = 0;      ///< bytes of text that the instrument will send with this header
  bool end = false;       ///< the message is whole with them
  std::string_view text;  ///< those of them that are here; views the transfer
};
/// The first transfer of a DEV_DEP_MSG_IN. Empty when it is none, or of another tag.
std::optional<UsbtmcIn> parse_usbtmc_in(std::span<const uint8_t> transfer, uint8_t tag);

}  // namespace v3d
