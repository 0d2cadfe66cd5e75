// Texts of strangers, for a terminal, a log or JSON.
#pragma once

#include <string>
#include <string_view>

namespace v3d {

/// The text with a '?' for every byte that is not of well-formed UTF-8, and for every control
/// character: it can neither move a cursor nor end a line.
std::string printable(std::string_view text);

}  // namespace v3d
