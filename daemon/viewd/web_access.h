// Who may look on.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "daemon/viewd/web_message.h"
#include "daemon/viewd/web_target.h"

namespace v3d {

/// Where to listen: "127.0.0.1:8330", "[::1]:8330", "0.0.0.0:8330".
struct WebAddress {
  std::string host;  ///< an IP address, without brackets
  uint16_t port = 0;
  bool is_loopback() const;
};
/// Throws InputError; `field` names it in the message.
WebAddress parse_web_address(std::string_view text, const std::string& field);

/// The only line of the file, 16 to 256 letters, digits, '-' and '_'. Throws InputError, with the
/// remedy, when there is none, when others than its owner and its group may read it or others than
/// its owner may write it; `field` names it in the message.
std::string load_web_token(const std::filesystem::path& path, const std::string& field);

/// Takes as long for a text that is nearly the token as for any other of its length.
bool is_same_token(std::string_view text, std::string_view token);

/// Without a token (then the server listens on this PC alone) whoever names this PC by a name of
/// its own may look on, so that no page of a stranger reaches us through a name that he lets point
/// here. With one, who shows it: as "Authorization: Bearer TOKEN", as the cookie, or once as
/// ?token=TOKEN, which sets the cookie.
class WebAccess {
 public:
  explicit WebAccess(std::string token) : token_(std::move(token)) {}

  enum class Verdict : uint8_t {
    kMay,
    kMayWithCookie,  ///< by the query: send set_cookie(), and on to the page without the token
    kWantsToken,
    kStrangeHost
  };
  Verdict judge(const WebRequest& request, const WebTarget& target) const;
  /// What is wrong with the field Host, in one line; empty where it is right. Right is one field: a
  /// name or an IP address and at most a port. User information ("user@host") would make the name
  /// that is checked another than the one that a proxy or a browser goes by.
  static std::string host_error(const WebRequest& request);
  /// A browser says which page opens a WebSocket; only ours may.
  static bool is_own_page(const WebRequest& request);
  std::string set_cookie() const;

 private:
  bool shows_token(const WebRequest& request) const;

  const std::string token_;  ///< empty: none is asked for
};

}  // namespace v3d
