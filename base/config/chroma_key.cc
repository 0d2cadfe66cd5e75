#include "base/config/chroma_key.h"

#include <algorithm>
#include <array>

namespace v3d {
namespace {

constexpr std::array<std::string_view, 3> kNames = {"none", "green", "blue"};

}  // namespace

std::string_view name(ChromaKey key) { return kNames[static_cast<size_t>(key)]; }

std::optional<ChromaKey> chroma_key_from_name(std::string_view name) {
  const auto found = std::ranges::find(kNames, name);
  if (found == kNames.end()) return std::nullopt;
  return static_cast<ChromaKey>(found - kNames.begin());
}

}  // namespace v3d
