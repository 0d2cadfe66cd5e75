// One HTTP connection: reads requests and sends answers. A WebSocket upgrade turns it into a
// WebSubscriber.
#pragma once

#include <boost/asio/ip/tcp.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <memory>
#include <string>

#include "daemon/web/web_connections.h"

namespace v3d {

/// Kept alive by its asynchronous operations. Used on the server's thread only.
class WebConnection : public std::enable_shared_from_this<WebConnection> {
 public:
  WebConnection(WebConnections& all, ConnectionSlots::Slot slot,
                boost::asio::ip::tcp::socket socket, std::string address);
  ~WebConnection();
  WebConnection(const WebConnection&) = delete;
  WebConnection& operator=(const WebConnection&) = delete;

  /// Reads and answers the next request. WebLimits::request_timeout applies to the whole request.
  void read();
  /// Cancels the pending operation, which ends the connection.
  void close() { socket_.close(); }

 private:
  bool is_open() const { return socket_.socket().is_open(); }
  void read_next();
  void on_header();
  void on_request(bool has_unread_body);
  void answer_or_defer(WebAnswer first, bool head_only);
  void answer(WebAnswer answer, bool head_only);
  struct TextSending;
  void send(const std::shared_ptr<TextSending>& sending);
  struct FileSending;
  void send_file(WebAnswer answer);
  void read_part(const std::shared_ptr<FileSending>& sending);
  void send_part(const std::shared_ptr<FileSending>& sending);
  void after_answer();

  WebConnections& all_;
  const ConnectionSlots::Id id_;
  std::unique_ptr<ConnectionSlot> slot_;  ///< null once moved to a WebSubscriber
  boost::beast::tcp_stream socket_;
  boost::beast::flat_buffer buffer_;
  boost::optional<boost::beast::http::request_parser<boost::beast::http::string_body>> parser_;
  const std::string address_;
  bool keep_alive_ = false;
};

}  // namespace v3d
