// HTTP and WebSocket connections.
#pragma once

#include <boost/asio/ip/tcp.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/websocket.hpp>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>

#include "daemon/web/connection_slots.h"
#include "daemon/web/web_message.h"
#include "daemon/web/web_server.h"

namespace v3d::web {

// State that the connections of a web server share: the handler, slots and subscribers.

class WebConnection;
class WebSubscriber;

/// Used on the server's thread only.
struct WebConnections {
  WebHandler& handler;
  WebLimits limits;
  ConnectionSlots slots = {};
  std::map<ConnectionSlots::Id, WebConnection*> open = {};
  std::set<WebSubscriber*> subscribers = {};
  /// Runs the work of a response on a thread of its kind, then calls `done` on the server's thread.
  /// Returns false if too much work waits.
  std::function<bool(WebResponse response, std::function<void(WebResponse)> done)> defer;
};

/// Holds the slot of a connection, and releases it on destruction.
class ConnectionSlot {
 public:
  ConnectionSlot(WebConnections& all, ConnectionSlots::Slot slot) : all_(all), slot_(slot) {}
  ~ConnectionSlot() { all_.slots.release(slot_.id); }
  ConnectionSlot(const ConnectionSlot&) = delete;
  ConnectionSlot& operator=(const ConnectionSlot&) = delete;
  WebConnections& all() const { return all_; }
  bool is_reserved() const { return slot_.is_reserved; }

 private:
  WebConnections& all_;
  const ConnectionSlots::Slot slot_;
};

// One HTTP connection: reads requests and sends responses. A WebSocket upgrade turns it into a
// WebSubscriber.

/// Kept alive by its asynchronous operations. Used on the server's thread only.
class WebConnection : public std::enable_shared_from_this<WebConnection> {
 public:
  WebConnection(WebConnections& all, ConnectionSlots::Slot slot,
                boost::asio::ip::tcp::socket socket, std::string address);
  ~WebConnection();
  WebConnection(const WebConnection&) = delete;
  WebConnection& operator=(const WebConnection&) = delete;

  /// Reads the next request and responds to it. WebLimits::request_timeout applies to the whole
  /// request.
  void read();
  /// Cancels the pending operation, which ends the connection.
  void close() { socket_.close(); }

 private:
  bool is_open() const { return socket_.socket().is_open(); }
  void read_next();
  void on_header();
  void on_request(bool has_unread_body);
  void respond_or_defer(WebResponse first, bool head_only);
  void respond(WebResponse response, bool head_only);
  struct TextSending;
  void send(const std::shared_ptr<TextSending>& sending);
  struct FileSending;
  void send_file(WebResponse response);
  void read_part(const std::shared_ptr<FileSending>& sending);
  void send_part(const std::shared_ptr<FileSending>& sending);
  void after_response();

  WebConnections& all_;
  const ConnectionSlots::Id id_;
  std::unique_ptr<ConnectionSlot> slot_;  ///< null once moved to a WebSubscriber
  boost::beast::tcp_stream socket_;
  boost::beast::flat_buffer buffer_;
  boost::optional<boost::beast::http::request_parser<boost::beast::http::string_body>> parser_;
  const std::string address_;
  bool keep_alive_ = false;
};

// A WebSocket client: sends it the messages of a WebStream, one at a time, and answers its pings.

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

}  // namespace v3d::web
