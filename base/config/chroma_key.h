// The colour of a studio whose background is painted for chroma keying.
#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

namespace v3d {

enum class ChromaKey : uint8_t { kNone, kGreen, kBlue };

/// "none", "green" or "blue", as in studio files and background models.
std::string_view name(ChromaKey key);
std::optional<ChromaKey> chroma_key_from_name(std::string_view name);

}  // namespace v3d
