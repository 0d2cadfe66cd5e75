// Images embedded in the HTML reports.
#pragma once

#include <cstdint>
#include <span>
#include <string>

namespace v3d {

/// A JPEG image as a data URL: "data:image/jpeg;base64,...".
std::string data_url(std::span<const uint8_t> jpeg);

}  // namespace v3d
