// One who watches over a WebSocket: sends the newest message, one at a time, and answers pings.
#pragma once

#include <boost/asio/ip/tcp.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/websocket.hpp>
#include <memory>
#include <optional>

#include "daemon/viewd/web_connections.h"

namespace v3d {

/// Shared by the operations that are under way, which end it. The server's thread only.
class WebSubscriber : public std::enable_shared_from_this<WebSubscriber> {
 public:
  using Request = boost::beast::http::request<boost::beast::http::string_body>;

  WebSubscriber(std::unique_ptr<ConnectionSlot> place, boost::asio::ip::tcp::socket socket,
                std::unique_ptr<WebStream> stream);
  ~WebSubscriber();
  WebSubscriber(const WebSubscriber&) = delete;
  WebSubscriber& operator=(const WebSubscriber&) = delete;

  /// Accepts the upgrade that `request` asks for.
  void begin(const Request& request);
  /// The next message, unless one is under way.
  void send();

 private:
  std::optional<WebMessage> next();
  void read();

  const std::unique_ptr<ConnectionSlot> place_;
  boost::beast::websocket::stream<boost::beast::tcp_stream> socket_;
  const std::unique_ptr<WebStream> stream_;
  boost::beast::flat_buffer received_;
  std::optional<int64_t> ping_;
  WebMessage under_way_;
};

}  // namespace v3d
