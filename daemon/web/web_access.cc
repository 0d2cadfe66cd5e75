#include "daemon/web/web_access.h"

#include <arpa/inet.h>
#include <sys/stat.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cstring>
#include <optional>
#include <span>
#include <utility>

#include "base/core/bytes.h"
#include "base/core/error.h"
#include "base/io/file.h"

namespace v3d::web {
namespace {

constexpr std::string_view kCookie = "v3d_token";
/// Name of the cookie for every token in older versions, still accepted.
constexpr std::string_view kOldCookie = "v3d_token=";
constexpr std::string_view kBearer = "Bearer ";

bool is_ip_address(const std::string& host) {
  std::array<unsigned char, sizeof(in6_addr)> bytes{};
  return inet_pton(AF_INET, host.c_str(), bytes.data()) == 1 ||
         inet_pton(AF_INET6, host.c_str(), bytes.data()) == 1;
}

bool is_loopback_name(std::string_view host) {
  return host == "localhost" || host == "::1" ||
         (host.starts_with("127.") && is_ip_address(std::string(host)));
}

/// The host of "localhost:8330" or "[::1]:8330", without port and brackets.
std::string_view name_in(std::string_view host) {
  if (host.starts_with('[')) {
    const size_t end = host.find(']');
    return end == std::string_view::npos ? "" : host.substr(1, end - 1);
  }
  return host.substr(0, host.find(':'));
}

bool is_token_character(char c) {
  return std::isalnum(static_cast<unsigned char>(c)) || c == '-' || c == '_';
}

/// Characters of names, of addresses in brackets with a zone ("[fe80::1%eth0]"), and of ports.
bool is_host_character(char c) {
  return std::isalnum(static_cast<unsigned char>(c)) ||
         std::string_view("-._:[]%").find(c) != std::string_view::npos;
}

std::string_view without_end_of_line(std::string_view text) {
  while (text.ends_with('\n') || text.ends_with('\r')) text.remove_suffix(1);
  return text;
}

/// Throws unless only the owner can write the token, and only owner and group can read it.
void check_permissions(const std::filesystem::path& path, const std::string& field) {
  struct stat state {};
  if (stat(path.c_str(), &state) != 0) {
    throw InputError(errno_message(field + ": " + path.string()) +
                     "; make one: (umask 027; openssl rand -hex 24 > " + path.string() + ")");
  }
  if ((state.st_mode & (S_IRWXO | S_IWGRP | S_IXGRP)) == 0) return;
  throw InputError(path.string() + ": others may read or change the token; try: chmod 640 " +
                   path.string());
}

}  // namespace

bool WebAddress::is_loopback() const { return is_loopback_name(host); }

WebAddress parse_web_address(std::string_view text, const std::string& field) {
  const size_t colon = text.rfind(':');
  WebAddress address{.host = {}, .port = 0, .field = field};
  if (colon != std::string_view::npos) {
    const std::string_view port = text.substr(colon + 1);
    const char* end = port.data() + port.size();
    const auto parsed = std::from_chars(port.data(), end, address.port);
    address.host = name_in(text.starts_with('[') ? text : text.substr(0, colon));
    if (parsed.ec == std::errc() && parsed.ptr == end && is_ip_address(address.host)) {
      return address;
    }
  }
  throw InputError(field + ": '" + std::string(text) +
                   "': expected ADDRESS:PORT, such as 127.0.0.1:8330 for this PC alone or "
                   "0.0.0.0:8330 for the network");
}

std::string load_web_token(const std::filesystem::path& path, const std::string& field) {
  check_permissions(path, field);
  const std::string text = read_file(path);
  const std::string token(without_end_of_line(text));
  if (token.size() < 16 || token.size() > 256 || !std::ranges::all_of(token, is_token_character)) {
    throw InputError(path.string() +
                     ": expected one line of 16 to 256 letters, digits, '-' and '_'");
  }
  return token;
}

bool is_same_token(std::string_view text, std::string_view token) {
  unsigned difference = text.size() == token.size() ? 0 : 1;
  for (size_t i = 0; i < std::min(text.size(), token.size()); ++i) {
    difference |= static_cast<unsigned char>(text[i] ^ token[i]);
  }
  return difference == 0;
}

namespace {

/// "v3d_token_1234567890=". A server that receives this name receives the token, too.
std::string cookie_of(std::string_view token) {
  const uint64_t sum =
      checksum({std::span(reinterpret_cast<const uint8_t*>(token.data()), token.size())});
  return std::string(kCookie) + "_" + std::to_string(static_cast<uint32_t>(sum)) + "=";
}

}  // namespace

WebAccess::WebAccess(std::string token) : token_(std::move(token)), cookie_(cookie_of(token_)) {}

bool WebAccess::is_cookie_with_token(std::string_view cookie) const {
  const auto has_name = [&](std::string_view name) {
    return cookie.starts_with(name) && is_same_token(cookie.substr(name.size()), token_);
  };
  return has_name(cookie_) || has_name(kOldCookie);
}

bool WebAccess::has_token(const WebRequest& request) const {
  const std::string_view field = request.authorization;
  if (field.starts_with(kBearer) && is_same_token(field.substr(kBearer.size()), token_))
    return true;
  std::string_view cookies = request.cookie;
  while (!cookies.empty()) {
    const std::string_view cookie = cookies.substr(0, cookies.find(';'));
    if (is_cookie_with_token(cookie)) return true;
    cookies.remove_prefix(std::min(cookies.size(), cookie.size() + 1));
    while (cookies.starts_with(' ')) cookies.remove_prefix(1);
  }
  return false;
}

WebAccess::Verdict WebAccess::check(const WebRequest& request, const WebTarget& target) const {
  if (token_.empty()) {
    return is_loopback_name(name_in(request.host)) ? Verdict::kAllowed : Verdict::kForeignHost;
  }
  const auto token = target.query.find("token");
  if (token != target.query.end() && is_same_token(token->second, token_))
    return Verdict::kAllowedWithCookie;
  return has_token(request) ? Verdict::kAllowed : Verdict::kTokenRequired;
}

std::string WebAccess::host_error(const WebRequest& request) {
  if (request.has_several_hosts) return "Host: expected one such field";
  if (std::ranges::all_of(request.host, is_host_character)) return {};
  return "Host: expected a name or an IP address and at most a port, no user information";
}

bool WebAccess::is_own_page(const WebRequest& request) {
  if (request.origin.empty()) return true;  // no browser
  return request.origin == "http://" + request.host || request.origin == "https://" + request.host;
}

std::string WebAccess::set_cookie() const {
  return cookie_ + token_ + "; Path=/; HttpOnly; SameSite=Strict; Max-Age=2592000";
}

namespace {

constexpr size_t kLongest = 2048;

/// Empty for a '%' without two hexadecimal digits, and for bytes that are not printable ASCII.
std::optional<std::string> decoded(std::string_view text) {
  std::string plain;
  for (size_t i = 0; i < text.size(); ++i) {
    unsigned char c = static_cast<unsigned char>(text[i]);
    if (c == '%') {
      const std::string_view digits = text.substr(i + 1, 2);
      const char* end = digits.data() + digits.size();
      const auto parsed = std::from_chars(digits.data(), end, c, 16);
      if (digits.size() != 2 || parsed.ec != std::errc() || parsed.ptr != end) return {};
      i += 2;
    }
    if (c < 0x20 || c > 0x7e) return {};
    plain += static_cast<char>(c);
  }
  return plain;
}

bool is_harmless(const std::string& segment) {
  return !segment.empty() && segment != "." && segment != ".." &&
         segment.find_first_of("/\\") == std::string::npos;
}

/// Calls `part` for each part between separators, until it returns false.
template <class Part>
bool each_part(std::string_view text, char separator, Part part) {
  while (true) {
    const size_t end = text.find(separator);
    if (!part(text.substr(0, end))) return false;
    if (end == std::string_view::npos) return true;
    text.remove_prefix(end + 1);
  }
}

bool read_path(std::string_view text, WebTarget& target) {
  if (text.empty()) return true;
  return each_part(text, '/', [&](std::string_view part) {
    auto segment = decoded(part);
    if (!segment || !is_harmless(*segment)) return false;
    target.path.push_back(std::move(*segment));
    return true;
  });
}

bool read_query(std::string_view text, WebTarget& target) {
  return each_part(text, '&', [&](std::string_view part) {
    const size_t equals = part.find('=');
    const auto name = decoded(part.substr(0, equals));
    const auto value = decoded(equals == std::string_view::npos ? "" : part.substr(equals + 1));
    if (!name || !value) return false;
    target.query[*name] = *value;
    return true;
  });
}

}  // namespace

std::string WebTarget::text() const {
  std::string text;
  for (const std::string& segment : path) text += "/" + segment;
  return text.empty() ? "/" : text;
}

std::optional<WebTarget> parse_web_target(std::string_view target) {
  if (target.size() > kLongest || !target.starts_with('/')) return {};
  WebTarget parsed;
  const size_t question = target.find('?');
  if (!read_path(target.substr(1, question == std::string_view::npos ? question : question - 1),
                 parsed)) {
    return {};
  }
  if (question == std::string_view::npos) return parsed;
  if (!read_query(target.substr(question + 1), parsed)) return {};
  return parsed;
}

namespace {

/// A number of decimal digits only.
std::optional<int64_t> number(std::string_view text) {
  int64_t value = 0;
  const char* end = text.data() + text.size();
  const auto parsed = std::from_chars(text.data(), end, value);
  const bool whole = !text.empty() && text.front() != '-' && parsed.ec == std::errc();
  return whole && parsed.ptr == end ? std::optional(value) : std::nullopt;
}

ByteRange part(int64_t first, int64_t size) {
  return {size > 0 ? ByteRange::Kind::kPart : ByteRange::Kind::kUnsatisfiable, first, size};
}

}  // namespace

ByteRange byte_range(std::string_view header, int64_t file_size) {
  const ByteRange whole{.kind = ByteRange::Kind::kWhole, .first = 0, .size = file_size};
  constexpr std::string_view kUnit = "bytes=";
  if (!header.starts_with(kUnit)) return whole;
  header.remove_prefix(kUnit.size());
  const size_t dash = header.find('-');
  if (dash == std::string_view::npos) return whole;
  const auto first = number(header.substr(0, dash));
  const auto last = number(header.substr(dash + 1));
  if (dash == 0) {  // "-500": the last 500 bytes
    if (!last) return whole;
    const int64_t size = std::min(*last, file_size);
    return part(file_size - size, size);
  }
  const bool open = dash + 1 == header.size();  // "500-": from there to the end
  if (!first || (!open && (!last || *last < *first))) return whole;
  if (*first >= file_size) return part(0, 0);
  const int64_t end = open ? file_size - 1 : std::min(*last, file_size - 1);
  return part(*first, end - *first + 1);
}

}  // namespace v3d::web
