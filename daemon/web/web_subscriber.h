// A WebSocket client: sends it the messages of a WebStream, one at a time, and answers its pings.
#pragma once

#include <boost/asio/ip/tcp.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/websocket.hpp>
#include <memory>
#include <optional>

#include "daemon/web/web_connections.h"

namespace v3d {

/// Kept alive by its asynchronous operations. Used on the server's thread only.
class WebSubscriber : public std::enable_shared_from_this<WebSubscriber> {
 public:
  using Request = boost::beast::http::request<boost::beast::http::string_body>;

  WebSubscriber(std::unique_ptr<ConnectionSlot> slot, boost::asio::ip::tcp::socket socket,
                std::unique_ptr<WebStream> stream);
  ~WebSubscriber();
  WebSubscriber(const WebSubscriber&) = delete;
  WebSubscriber& operator=(const WebSubscriber&) = delete;

  /// Accepts the upgrade of `request`.
  void start(const Request& request);
  /// Sends the next message, unless one is being sent.
  void send();

 private:
  std::optional<WebMessage> next();
  void read();

  const std::unique_ptr<ConnectionSlot> slot_;
  boost::beast::websocket::stream<boost::beast::tcp_stream> socket_;
  const std::unique_ptr<WebStream> stream_;
  boost::beast::flat_buffer received_;
  std::optional<int64_t> ping_;
  WebMessage sending_;
};

}  // namespace v3d
