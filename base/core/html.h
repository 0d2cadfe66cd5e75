// Pieces of a page for people: one HTML file with its pictures in it, that needs nothing but a
// browser.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace v3d {

/// From the doctype to the opening of the body, with the style that our pages share. `title` is
/// plain text.
std::string html_head(std::string_view title);

/// Plain text as text of a page.
std::string html_escaped(std::string_view text);

/// "data:image/jpeg;base64,...".
std::string data_url(const std::vector<uint8_t>& jpeg);

}  // namespace v3d
