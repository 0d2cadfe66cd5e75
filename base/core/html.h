// Parts of the HTML reports: one self-contained file with embedded images.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace v3d {

/// The page up to and including <body>, with the common style of all reports. `title` is plain
/// text.
std::string html_head(std::string_view title);

/// Plain text escaped for HTML.
std::string html_escaped(std::string_view text);

/// A JPEG image as a data URL: "data:image/jpeg;base64,...".
std::string data_url(const std::vector<uint8_t>& jpeg);

}  // namespace v3d
