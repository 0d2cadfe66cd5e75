// Makes untrusted text safe for a terminal, a log or JSON.
#pragma once

#include <string>
#include <string_view>

namespace v3d {

/// Replaces each byte of invalid UTF-8 and each control character by '?'. The result cannot move a
/// cursor or end a line.
std::string printable(std::string_view text);

}  // namespace v3d
