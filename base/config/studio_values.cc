#include "base/config/studio_values.h"

#include <arpa/inet.h>
#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <string_view>

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

namespace {

bool is_multicast(const std::string& text) {
  in_addr address{};
  return inet_pton(AF_INET, text.c_str(), &address) == 1 && IN_MULTICAST(ntohl(address.s_addr));
}

/// Parses a text of decimal digits only, with a value of at most `max`.
bool read_number(std::string_view text, int max, int& number) {
  const char* const end = text.data() + text.size();
  const auto [read, error] = std::from_chars(text.data(), end, number);
  return error == std::errc() && read == end && number >= 0 && number <= max;
}

/// False when `option` is ttl or recv_buf_size with an invalid value.
bool read_option(std::string_view option, LcmOptions& options) {
  constexpr int kMaxTtl = 255;
  constexpr int kMaxBuffer = 1 << 30;
  const size_t equals = std::min(option.find('='), option.size());
  const std::string_view name = option.substr(0, equals);
  const std::string_view value = option.substr(std::min(equals + 1, option.size()));
  if (name == "ttl") return read_number(value, kMaxTtl, options.ttl);
  if (name == "recv_buf_size") return read_number(value, kMaxBuffer, options.recv_buf_size);
  return true;
}

}  // namespace

std::optional<LcmGroup> lcm_group(const std::string& url) {
  constexpr std::string_view kScheme = "udpm://";
  if (!url.starts_with(kScheme)) return std::nullopt;
  const std::string endpoint = url.substr(kScheme.size(), url.find('?') - kScheme.size());
  const size_t colon = endpoint.find(':');
  LcmGroup group;
  if (!endpoint.substr(0, colon).empty()) group.address = endpoint.substr(0, colon);
  if (!is_multicast(group.address)) return std::nullopt;
  if (colon == std::string::npos) return group;
  const char* const end = endpoint.data() + endpoint.size();
  const auto [read, error] = std::from_chars(endpoint.data() + colon + 1, end, group.port);
  if (error != std::errc() || read != end || group.port == 0) return std::nullopt;
  return group;
}

std::optional<LcmOptions> lcm_options(const std::string& url) {
  LcmOptions options;
  std::string_view rest(url);
  rest.remove_prefix(std::min(rest.find('?'), rest.size()));
  while (!rest.empty()) {
    rest.remove_prefix(1);  // '?' or '&'
    const std::string_view option = rest.substr(0, rest.find('&'));
    if (!read_option(option, options)) return std::nullopt;
    rest.remove_prefix(option.size());
  }
  return options;
}

std::string pulse_rate_error(double hz) {
  return fmt::format("a pulse rate of {:g} Hz is not possible; expected {:g} to {:g} Hz", hz,
                     kMinPulseRateHz, kMaxPulseRateHz);
}

}  // namespace v3d
