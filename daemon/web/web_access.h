// Targets of requests and access to them.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "daemon/web/web_message.h"

namespace v3d::web {

// The target and the Range field of an HTTP request, parsed. Safe for hostile input.

/// A request target: decoded path segments and query.
struct WebTarget {
  std::vector<std::string> path;  ///< "/takes/kendo-07" is {"takes", "kendo-07"}; "/" is empty
  std::map<std::string, std::string> query;

  /// "/takes/kendo-07"
  std::string text() const;
};

/// Decodes percent-encoding (RFC 3986) once. Empty for a target of more than 2048 bytes, without
/// leading '/', with a segment that is empty, "." or "..", or with a decoded byte that is '/', '\'
/// or not printable ASCII.
std::optional<WebTarget> parse_web_target(std::string_view target);

/// The part of a file that a Range field requests. Source: RFC 9110, section 14.
struct ByteRange {
  enum class Kind : uint8_t {
    kWhole,         ///< no range was requested, or an unsupported one: several, or malformed
    kPart,          ///< [first, first + size)
    kUnsatisfiable  ///< begins after the end of the file
  } kind = Kind::kWhole;
  int64_t first = 0;
  int64_t size = 0;
};

/// `header`: the value of the field; empty if absent. `file_size`: 0 or more. A kPart lies inside
/// the file.
ByteRange byte_range(std::string_view header, int64_t file_size);

// Access control of the web server: tokens, host names, origins.

/// The address to listen on: "127.0.0.1:8330", "[::1]:8330", "0.0.0.0:8330".
struct WebAddress {
  std::string host;  ///< an IP address, without brackets
  uint16_t port = 0;
  std::string field = {};  ///< of the studio file, for error messages
  bool is_loopback() const;
};
/// `field`: name of the field in the studio file. Throws InputError with it if the text is not an
/// address.
WebAddress parse_web_address(std::string_view text, const std::string& field);

/// Reads a token: the only line of the file, 16 to 256 letters, digits, '-' and '_'. Throws
/// InputError with `field` and a remedy if there is none, if users other than owner and group may
/// read it, or if users other than the owner may write it.
std::string load_web_token(const std::filesystem::path& path, const std::string& field);

/// Compares in constant time for texts of equal length.
bool is_same_token(std::string_view text, std::string_view token);

/// Decides whether a request is allowed.
///
/// Without a token, the server listens only on this PC, and the Host field must name this PC by a
/// loopback name. So a page of another site cannot reach the server through a host name that it
/// points to this PC (DNS rebinding). With a token, the request must contain it: as "Authorization:
/// Bearer TOKEN", as the cookie, or once as ?token=TOKEN, which sets the cookie.
class WebAccess {
 public:
  explicit WebAccess(std::string token);

  enum class Verdict : uint8_t {
    kAllowed,
    kAllowedWithCookie,  ///< by the query: send set_cookie(), and redirect to the page without the
                         ///< token
    kTokenRequired,
    kForeignHost
  };
  Verdict check(const WebRequest& request, const WebTarget& target) const;
  /// The error of the Host field in one line; empty if it is valid: one field with a name or an IP
  /// address and at most a port. User information ("user@host") is refused, because browsers and
  /// proxies would use another name than the one that is checked.
  static std::string host_error(const WebRequest& request);
  /// Was the request sent by a page of this server, or not by a browser? Checks the Origin field.
  static bool is_own_page(const WebRequest& request);
  /// The name of the cookie depends on the token: browsers send the cookies of a host to all its
  /// ports, and two studios behind one host name would replace each other's cookie.
  std::string set_cookie() const;

 private:
  bool has_token(const WebRequest& request) const;
  bool is_cookie_with_token(std::string_view cookie) const;

  const std::string token_;   ///< empty: none is required
  const std::string cookie_;  ///< name of the cookie, with '='
};

}  // namespace v3d::web
