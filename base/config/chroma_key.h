// The colour of a studio that is painted to be told from whoever stands in it.
#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

namespace v3d {

enum class ChromaKey : uint8_t { kNone, kGreen, kBlue };

/// "none", "green", "blue"; what studio files and background models say.
std::string_view name(ChromaKey key);
std::optional<ChromaKey> chroma_key_from_name(std::string_view name);

}  // namespace v3d
