// One HTTP connection: reads requests, sends answers, and becomes a WebSubscriber when asked to.
#pragma once

#include <boost/asio/ip/tcp.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <memory>
#include <string>

#include "daemon/viewd/web_connections.h"

namespace v3d {

/// Shared by the operations that are under way, which end it. The server's thread only.
class WebConnection : public std::enable_shared_from_this<WebConnection> {
 public:
  WebConnection(WebConnections& all, ConnectionSlots::Place place,
                boost::asio::ip::tcp::socket socket, std::string address);
  ~WebConnection();
  WebConnection(const WebConnection&) = delete;
  WebConnection& operator=(const WebConnection&) = delete;

  /// Reads a request and answers it. One time limit for the whole request, however slowly its bytes
  /// come.
  void read();
  /// Ends the operation under way, which ends the connection.
  void close() { socket_.close(); }

 private:
  bool is_open() const { return socket_.socket().is_open(); }
  void read_next();
  void take_header();
  void take(bool has_unread_body);
  void answer_or_work(WebAnswer first, bool head_only);
  void answer(WebAnswer answer, bool head_only);
  template <class Body>
  void send(boost::beast::http::response<Body> response);
  template <class Sending>
  void send_some(const std::shared_ptr<Sending>& sending);
  void after_answer();

  WebConnections& all_;
  const ConnectionSlots::Id id_;
  std::unique_ptr<ConnectionSlot> place_;  ///< null once a WebSubscriber has it
  boost::beast::tcp_stream socket_;
  boost::beast::flat_buffer buffer_;
  boost::optional<boost::beast::http::request_parser<boost::beast::http::string_body>> parser_;
  const std::string address_;
  bool keep_alive_ = false;
};

}  // namespace v3d
