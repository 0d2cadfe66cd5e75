#include "daemon/web/web_connection.h"

#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <boost/asio/write.hpp>
#include <charconv>
#include <chrono>
#include <limits>
#include <nlohmann/json.hpp>
#include <string_view>
#include <utility>

#include "base/core/time.h"
#include "base/io/unique_fd.h"

namespace v3d::web {
namespace {

namespace beast = boost::beast;
namespace http = beast::http;
namespace websocket = beast::websocket;
using boost::asio::ip::tcp;
using boost::system::error_code;
using Request = WebSubscriber::Request;

constexpr std::chrono::seconds kSendTimeout{30};  ///< for each part of a response
constexpr std::chrono::seconds kIdleTimeout{30};  ///< between requests

std::string text(boost::string_view view) { return {view.data(), view.size()}; }

WebRequest to_web_request(const Request& request, const std::string& address) {
  return {.method = text(request.method_string()),
          .target = text(request.target()),
          .host = text(request[http::field::host]),
          .has_several_hosts = request.count(http::field::host) > 1,
          .origin = text(request[http::field::origin]),
          .range = text(request[http::field::range]),
          .if_range = text(request[http::field::if_range]),
          .if_none_match = text(request[http::field::if_none_match]),
          .cookie = text(request[http::field::cookie]),
          .authorization = text(request[http::field::authorization]),
          .content_type = text(request[http::field::content_type]),
          .operator_token = text(request["X-V3D-Operator"]),
          .address = address,
          .body = request.body()};
}

/// Sets the header. Its policies forbid MIME sniffing, framing, and content of other servers.
template <class Message>
void set_head(Message& message, const WebResponse& response, bool keep_alive) {
  message.result(static_cast<unsigned>(response.status));
  message.set(http::field::server, "v3d");
  message.set(http::field::content_type, response.type);
  message.set("X-Content-Type-Options", "nosniff");
  message.set("Referrer-Policy", "no-referrer");
  message.set("Content-Security-Policy",
              "default-src 'self'; script-src 'self' 'wasm-unsafe-eval'; img-src 'self' blob: "
              "data:; connect-src 'self' blob: data:; worker-src 'self'; frame-ancestors 'none'");
  for (const auto& [name, value] : response.fields) message.set(name, value);
  message.keep_alive(keep_alive);
}

/// The next bytes of a file, as the body of a response; another status when there are none.
WebResponse read_file_part(const FilePart& part) {
  constexpr int64_t kMaxBytes = 256 << 10;
  std::string bytes(static_cast<size_t>(std::min(part.size, kMaxBytes)), '\0');
  const ssize_t got = io::uninterrupted(
      [&] { return pread(part.file->get(), bytes.data(), bytes.size(), part.first); });
  if (got <= 0) return plain_response(500, "the file ended or cannot be read");
  bytes.resize(static_cast<size_t>(got));
  return {.body = std::move(bytes)};
}

/// Whether the client has this text already, by its ETag. Responses with files decide that before
/// they open the file.
bool is_known(const WebResponse& response, const Request& request) {
  if (response.status != 200 || response.file) return false;
  const std::string known = text(request[http::field::if_none_match]);
  return !known.empty() && std::ranges::any_of(response.fields, [&](const auto& field) {
    return field.first == "ETag" && field.second == known;
  });
}

WebResponse busy() {
  return {
      .status = 503, .body = "too many requests; try again\n", .fields = {{"Retry-After", "1"}}};
}

}  // namespace

WebConnection::WebConnection(WebConnections& all, ConnectionSlots::Slot slot, tcp::socket socket,
                             std::string address)
    : all_(all),
      id_(slot.id),
      slot_(std::make_unique<ConnectionSlot>(all, slot)),
      socket_(std::move(socket)),
      address_(std::move(address)) {
  all_.open[id_] = this;
}

WebConnection::~WebConnection() { all_.open.erase(id_); }

// --- requests -----------------------------------------------------------------------------------

// close() may be called between the success of an operation and its handler, so handlers check
// is_open().

void WebConnection::read() {
  parser_.emplace();
  parser_->header_limit(WebServer::kMaxHeaderBytes);
  // No limit yet, so that a request with too large a body gets a response. With a limit of zero,
  // Beast would reject every body.
  parser_->body_limit(std::numeric_limits<uint64_t>::max());
  parser_->eager(false);
  socket_.expires_after(all_.limits.request_timeout);
  http::async_read_header(socket_, buffer_, *parser_,
                          [self = shared_from_this()](error_code error, size_t) {
                            if (!error && self->is_open()) self->on_header();
                          });
}

/// Waits kIdleTimeout for the first bytes of the next request, then reads it.
void WebConnection::read_next() {
  if (buffer_.size() > 0) return read();
  socket_.expires_after(kIdleTimeout);
  socket_.async_read_some(buffer_.prepare(WebServer::kMaxHeaderBytes),
                          [self = shared_from_this()](error_code error, size_t bytes) {
                            if (error || !self->is_open()) return;
                            self->buffer_.commit(bytes);
                            self->read();
                          });
}

/// Reads the body of a short POST only. After the response to another request with a body, the
/// connection ends, because the unread body would be parsed as the next request.
void WebConnection::on_header() {
  const Request& request = parser_->get();
  const auto size = parser_->content_length();
  const bool has_body = parser_->chunked() || (size && *size > 0);
  keep_alive_ = all_.limits.keeps_alive && request.keep_alive() && !has_body;
  if (!has_body) return on_request(false);
  if (request.method() != http::verb::post || parser_->chunked() ||
      *size > WebServer::kMaxBodyBytes) {
    return on_request(true);
  }
  parser_->body_limit(WebServer::kMaxBodyBytes);
  http::async_read(socket_, buffer_, *parser_,
                   [self = shared_from_this()](error_code error, size_t) {
                     if (!error && self->is_open()) self->on_request(false);
                   });
}

void WebConnection::on_request(bool has_unread_body) {
  const Request& request = parser_->get();
  WebHandler& handler = all_.handler;
  WebRequest web_request = to_web_request(request, address_);
  web_request.has_unread_body = has_unread_body;
  const ClientRole role = handler.role_of(web_request);
  all_.slots.set_role(id_, role);
  if (slot_->is_reserved()) {
    keep_alive_ = false;  // free the slot for the next operator
    if (role != ClientRole::kOperator || websocket::is_upgrade(request)) {
      return respond(busy(), request.method() == http::verb::head);
    }
  }
  if (!websocket::is_upgrade(request)) {
    respond_or_defer(handler.respond(web_request), request.method() == http::verb::head);
    return;
  }
  WebHandler::Opening opening = handler.open_stream(web_request);
  if (!opening.stream) {
    respond(std::move(opening.refusal), false);
    return;
  }
  socket_.expires_never();
  std::make_shared<WebSubscriber>(std::move(slot_), socket_.release_socket(),
                                  std::move(opening.stream))
      ->start(request);
}

void WebConnection::respond_or_defer(WebResponse first, bool head_only) {
  if (!first.work) return respond(std::move(first), head_only);
  const bool is_deferred =
      all_.defer(std::move(first), [self = shared_from_this(), head_only](WebResponse made) {
        self->respond(std::move(made), head_only);
      });
  if (!is_deferred) respond(busy(), head_only);
}

// --- responses -----------------------------------------------------------------------------------

/// Exists until the last byte was sent; the serializer refers to the message.
struct WebConnection::TextSending {
  http::response<http::string_body> message{};
  http::response_serializer<http::string_body> serializer{message};
};

void WebConnection::respond(WebResponse response, bool head_only) {
  if (is_known(response, parser_->get())) {
    response.status = 304;
    response.body.clear();
  }
  if (response.file && !head_only) return send_file(std::move(response));
  const auto sending = std::make_shared<TextSending>();
  auto& message = sending->message;
  set_head(message, response, keep_alive_);
  const auto size =
      response.file ? response.file->size : static_cast<int64_t>(response.body.size());
  message.body() = head_only ? "" : std::move(response.body);
  if (head_only) {
    message.content_length(static_cast<uint64_t>(size));
  } else if (response.status != 304) {
    message.prepare_payload();
  }
  send(sending);
}

/// Sends in parts, each with its own timeout, because the network may be slow.
void WebConnection::send(const std::shared_ptr<TextSending>& sending) {
  socket_.expires_after(kSendTimeout);
  http::async_write_some(socket_, sending->serializer,
                         [self = shared_from_this(), sending](error_code error, size_t) {
                           if (error) return;
                           if (!sending->serializer.is_done()) return self->send(sending);
                           self->after_response();
                         });
}

/// A response with a file: the header is sent first.
struct WebConnection::FileSending {
  explicit FileSending(FilePart file) : part(std::move(file)) {}
  FilePart part;      ///< what was not read yet
  std::string bytes;  ///< what was read and is being sent
  http::response<http::empty_body> message{};
  http::response_serializer<http::empty_body> serializer{message};
};

void WebConnection::send_file(WebResponse response) {
  const auto sending = std::make_shared<FileSending>(std::move(*response.file));
  set_head(sending->message, response, keep_alive_);
  sending->message.content_length(static_cast<uint64_t>(sending->part.size));
  socket_.expires_after(kSendTimeout);
  http::async_write_header(socket_, sending->serializer,
                           [self = shared_from_this(), sending](error_code error, size_t) {
                             if (!error) self->read_part(sending);
                           });
}

/// The connection ends, so that the client notices the missing bytes, when the file has become
/// shorter, or the disk is late or fails.
void WebConnection::read_part(const std::shared_ptr<FileSending>& sending) {
  if (sending->part.size == 0) return after_response();
  WebResponse reading{.work = [part = sending->part] { return read_file_part(part); },
                      .kind = sending->part.kind};
  all_.defer(std::move(reading), [self = shared_from_this(), sending](WebResponse read) {
    if (read.status != 200) return;
    sending->bytes = std::move(read.body);
    self->send_part(sending);
  });
}

void WebConnection::send_part(const std::shared_ptr<FileSending>& sending) {
  socket_.expires_after(kSendTimeout);
  boost::asio::async_write(socket_, boost::asio::buffer(sending->bytes),
                           [self = shared_from_this(), sending](error_code error, size_t bytes) {
                             if (error) return;
                             sending->part.first += static_cast<int64_t>(bytes);
                             sending->part.size -= static_cast<int64_t>(bytes);
                             self->read_part(sending);
                           });
}

void WebConnection::after_response() {
  if (keep_alive_) return read_next();
  error_code ignored;
  socket_.socket().shutdown(tcp::socket::shutdown_send, ignored);
}

namespace {

namespace asio = boost::asio;
namespace websocket = boost::beast::websocket;

constexpr std::chrono::seconds kHandshakeTimeout{30};
constexpr std::chrono::seconds kSubscriberTimeout{20};
constexpr size_t kMaxReceivedBytes = 256;
/// Send buffer in the kernel, for what was sent and is not acknowledged. Linux doubles the number.
constexpr int kSendBuffer = 256 << 10;
/// The kernel accepts more bytes while fewer than these were not sent. Without this limit, a slow
/// link has the whole send buffer before it, and states and pings are seconds late.
constexpr int kMaxUnsentBytes = 16 << 10;

/// The number of "ping 123"; empty for anything else.
std::optional<int64_t> ping_in(std::string_view message) {
  constexpr std::string_view kPing = "ping ";
  if (!message.starts_with(kPing)) return {};
  message.remove_prefix(kPing.size());
  int64_t number = 0;
  const char* end = message.data() + message.size();
  const auto parsed = std::from_chars(message.data(), end, number);
  return parsed.ec == std::errc() && parsed.ptr == end ? std::optional(number) : std::nullopt;
}

std::string pong_json(int64_t ping, RealtimeInstant now) {
  return nlohmann::json{{"type", "pong"}, {"ping", ping}, {"now_ms", 1e-6 * to_ns(now)}}.dump();
}

}  // namespace

WebSubscriber::WebSubscriber(std::unique_ptr<ConnectionSlot> slot, asio::ip::tcp::socket socket,
                             std::unique_ptr<WebStream> stream)
    : slot_(std::move(slot)), socket_(std::move(socket)), stream_(std::move(stream)) {}

WebSubscriber::~WebSubscriber() { slot_->all().subscribers.erase(this); }

void WebSubscriber::start(const Request& request) {
  error_code ignored;
  socket_.next_layer().socket().set_option(asio::socket_base::send_buffer_size(kSendBuffer),
                                           ignored);
  setsockopt(socket_.next_layer().socket().native_handle(), IPPROTO_TCP, TCP_NOTSENT_LOWAT,
             &kMaxUnsentBytes, sizeof kMaxUnsentBytes);
  websocket::stream_base::timeout limits{};
  limits.handshake_timeout = kHandshakeTimeout;
  limits.idle_timeout = kSubscriberTimeout;
  limits.keep_alive_pings = true;
  socket_.set_option(limits);
  socket_.read_message_max(kMaxReceivedBytes);
  socket_.async_accept(request, [self = shared_from_this()](error_code error) {
    if (error) return;
    self->slot_->all().subscribers.insert(self.get());
    self->read();
    self->send();
  });
}

void WebSubscriber::send() {
  if (sending_.bytes != nullptr) return;
  auto message = next();
  if (!message) return;
  sending_ = std::move(*message);
  socket_.text(sending_.is_text);
  socket_.async_write(asio::buffer(*sending_.bytes),
                      [self = shared_from_this()](error_code error, size_t /*bytes*/) {
                        self->sending_ = {};
                        if (!error) self->send();
                      });
}

std::optional<WebMessage> WebSubscriber::next() {
  if (!ping_) return stream_->next();
  auto pong = std::make_shared<const std::string>(pong_json(*ping_, Realtime::now()));
  ping_.reset();
  return WebMessage{.is_text = true, .bytes = std::move(pong)};
}

void WebSubscriber::read() {
  socket_.async_read(received_, [self = shared_from_this()](error_code error, size_t /*bytes*/) {
    if (error) return;
    const auto data = self->received_.data();
    if (const auto ping = ping_in({static_cast<const char*>(data.data()), data.size()})) {
      self->ping_ = ping;  // of several pings, only the last is answered
    }
    self->received_.consume(self->received_.size());
    self->send();
    self->read();
  });
}

}  // namespace v3d::web
