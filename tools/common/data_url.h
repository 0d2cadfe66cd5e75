// Bytes as text: base64, and images embedded in the HTML reports.
#pragma once

#include <cstdint>
#include <span>
#include <string>

namespace v3d {

/// Base64 with padding (RFC 4648, section 4).
std::string base64(std::span<const uint8_t> bytes);

/// A JPEG image as a data URL: "data:image/jpeg;base64,...".
std::string data_url(std::span<const uint8_t> jpeg);

}  // namespace v3d
