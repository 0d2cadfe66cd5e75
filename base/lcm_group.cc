#include "base/lcm_group.h"

#include <arpa/inet.h>

#include <charconv>
#include <string_view>

namespace v3d {
namespace {

bool is_multicast(const std::string& text) {
  in_addr address{};
  return inet_pton(AF_INET, text.c_str(), &address) == 1 && IN_MULTICAST(ntohl(address.s_addr));
}

}  // namespace

std::optional<LcmGroup> lcm_group(const std::string& url) {
  constexpr std::string_view kScheme = "udpm://";
  if (!url.starts_with(kScheme)) return std::nullopt;
  const std::string place = url.substr(kScheme.size(), url.find('?') - kScheme.size());
  const size_t colon = place.find(':');
  LcmGroup group;
  if (!place.substr(0, colon).empty()) group.address = place.substr(0, colon);
  if (!is_multicast(group.address)) return std::nullopt;
  if (colon == std::string::npos) return group;
  const char* const end = place.data() + place.size();
  const auto [read, error] = std::from_chars(place.data() + colon + 1, end, group.port);
  if (error != std::errc() || read != end || group.port == 0) return std::nullopt;
  return group;
}

}  // namespace v3d
