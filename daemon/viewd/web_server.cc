#include "daemon/viewd/web_server.h"

#include <spdlog/spdlog.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/thread_pool.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/websocket.hpp>
#include <charconv>
#include <future>
#include <limits>
#include <map>
#include <set>
#include <thread>
#include <utility>

#include "base/error.h"
#include "daemon/viewd/connection_places.h"
#include "daemon/viewd/listing_runner.h"
#include "daemon/viewd/view_json.h"

namespace v3d {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
namespace websocket = beast::websocket;
using asio::ip::tcp;
using boost::system::error_code;

constexpr std::chrono::seconds kSendWithin{30};  ///< each piece of an answer
constexpr std::chrono::seconds kIdleFor{30};     ///< between requests
constexpr std::chrono::seconds kWatcherSilentFor{20};
constexpr std::chrono::milliseconds kAcceptAgain{100};
constexpr size_t kMostFromWatcher = 256;
/// What the kernel may hold for one who watches: some frames, or live would not be live.
constexpr int kSendBuffer = 256 << 10;

// NOLINTBEGIN(readability-identifier-naming): named as Beast wants a body to be

/// The body of a response that is a part of a file, read while it is sent.
struct FilePartBody {
  using value_type = FilePart;
  static uint64_t size(const FilePart& part) { return static_cast<uint64_t>(part.size); }

  class writer {
   public:
    using const_buffers_type = asio::const_buffer;
    template <bool isRequest, class Fields>
    writer(http::header<isRequest, Fields>& /*header*/, FilePart& part) : part_(part) {}
    void init(error_code& error) { error = {}; }
    boost::optional<std::pair<const_buffers_type, bool>> get(error_code& error) {
      error = {};
      if (part_.size == 0) return boost::none;
      const auto wanted = std::min<int64_t>(part_.size, static_cast<int64_t>(chunk_.size()));
      const ssize_t got =
          pread(part_.file->fd(), chunk_.data(), static_cast<size_t>(wanted), part_.first);
      if (got <= 0) {  // shorter than it was a moment ago: the connection ends
        error = http::make_error_code(http::error::partial_message);
        return boost::none;
      }
      part_.first += got;
      part_.size -= got;
      return {{const_buffers_type(chunk_.data(), static_cast<size_t>(got)), part_.size > 0}};
    }

   private:
    FilePart& part_;
    std::array<char, 64 << 10> chunk_{};
  };
};

// NOLINTEND(readability-identifier-naming)

using Request = http::request<http::string_body>;

std::string text(boost::string_view view) { return {view.data(), view.size()}; }

WebRequest plain(const Request& request, const std::string& address) {
  return {.method = text(request.method_string()),
          .target = text(request.target()),
          .host = text(request[http::field::host]),
          .has_several_hosts = request.count(http::field::host) > 1,
          .origin = text(request[http::field::origin]),
          .range = text(request[http::field::range]),
          .if_none_match = text(request[http::field::if_none_match]),
          .cookie = text(request[http::field::cookie]),
          .authorization = text(request[http::field::authorization]),
          .content_type = text(request[http::field::content_type]),
          .operator_token = text(request["X-V3D-Operator"]),
          .address = address,
          .body = request.body()};
}

/// What every answer says: nothing is guessed, framed or fetched from elsewhere.
template <class Response>
void set_head(Response& response, const WebAnswer& answer, bool keep_alive) {
  response.result(static_cast<unsigned>(answer.status));
  response.set(http::field::server, "v3d-viewd");
  response.set(http::field::content_type, answer.type);
  response.set("X-Content-Type-Options", "nosniff");
  response.set("Referrer-Policy", "no-referrer");
  response.set("Content-Security-Policy",
               "default-src 'self'; script-src 'self' 'wasm-unsafe-eval'; img-src 'self' blob: "
               "data:; connect-src 'self' blob: data:; worker-src 'self'; frame-ancestors 'none'");
  for (const auto& [name, value] : answer.fields) response.set(name, value);
  response.keep_alive(keep_alive);
}

/// "ping 123": the number; nothing for anything else.
std::optional<int64_t> ping_in(std::string_view message) {
  constexpr std::string_view kPing = "ping ";
  if (!message.starts_with(kPing)) return {};
  message.remove_prefix(kPing.size());
  int64_t number = 0;
  const char* end = message.data() + message.size();
  const auto parsed = std::from_chars(message.data(), end, number);
  return parsed.ec == std::errc() && parsed.ptr == end ? std::optional(number) : std::nullopt;
}

class Connection;
class Watcher;

/// What all connections share; the server's thread only.
struct Shared {
  WebSite& site;
  WebServer::Watch watch;
  WebLimits limits;
  ConnectionPlaces places = {};
  std::map<ConnectionPlaces::Id, Connection*> connections = {};
  std::set<Watcher*> watchers = {};
  /// Does the work of an answer on the thread for it, then calls `done` on the server's. False when
  /// too much waits there.
  std::function<bool(WebAnswer answer, std::function<void(WebAnswer)> done)> defer;
};

/// Holds the place of a connection.
class Counted {
 public:
  Counted(Shared& shared, ConnectionPlaces::Place place) : shared_(shared), place_(place) {}
  ~Counted() { shared_.places.leave(place_.id); }
  Counted(const Counted&) = delete;
  Counted& operator=(const Counted&) = delete;
  Shared& shared() const { return shared_; }
  const ConnectionPlaces::Place& place() const { return place_; }

 private:
  Shared& shared_;
  const ConnectionPlaces::Place place_;
};

/// One who watches over a WebSocket. Shared by the operations that are under way, which end it.
class Watcher : public std::enable_shared_from_this<Watcher> {
 public:
  Watcher(std::unique_ptr<Counted> counted, tcp::socket socket, std::unique_ptr<WebStream> stream)
      : counted_(std::move(counted)), socket_(std::move(socket)), stream_(std::move(stream)) {}
  ~Watcher() { counted_->shared().watchers.erase(this); }
  Watcher(const Watcher&) = delete;
  Watcher& operator=(const Watcher&) = delete;

  void begin(const Request& request) {
    error_code ignored;
    socket_.next_layer().socket().set_option(asio::socket_base::send_buffer_size(kSendBuffer),
                                             ignored);
    websocket::stream_base::timeout limits{};
    limits.handshake_timeout = kSendWithin;
    limits.idle_timeout = kWatcherSilentFor;
    limits.keep_alive_pings = true;
    socket_.set_option(limits);
    socket_.read_message_max(kMostFromWatcher);
    socket_.async_accept(request, [self = shared_from_this()](error_code error) {
      if (error) return;
      self->counted_->shared().watchers.insert(self.get());
      self->read();
      self->send();
    });
  }

  /// The next message, unless one is under way.
  void send() {
    if (under_way_.bytes != nullptr) return;
    if (auto message = next()) {
      under_way_ = std::move(*message);
      socket_.text(under_way_.is_text);
      socket_.async_write(asio::buffer(*under_way_.bytes),
                          [self = shared_from_this()](error_code error, size_t /*bytes*/) {
                            self->under_way_ = {};
                            if (!error) self->send();
                          });
    }
  }

 private:
  std::optional<WebMessage> next() {
    if (!ping_) return stream_->next();
    auto pong = std::make_shared<const std::string>(pong_json(*ping_, Realtime::now()));
    ping_.reset();
    return WebMessage{.is_text = true, .bytes = std::move(pong)};
  }

  void read() {
    socket_.async_read(heard_, [self = shared_from_this()](error_code error, size_t /*bytes*/) {
      if (error) return;
      const auto data = self->heard_.data();
      if (const auto ping = ping_in({static_cast<const char*>(data.data()), data.size()})) {
        self->ping_ = ping;  // of several only the last is answered
      }
      self->heard_.consume(self->heard_.size());
      self->send();
      self->read();
    });
  }

  const std::unique_ptr<Counted> counted_;
  websocket::stream<beast::tcp_stream> socket_;
  const std::unique_ptr<WebStream> stream_;
  beast::flat_buffer heard_;
  std::optional<int64_t> ping_;
  WebMessage under_way_;
};

/// One HTTP connection. Shared by the operations that are under way, which end it.
class Connection : public std::enable_shared_from_this<Connection> {
 public:
  Connection(Shared& shared, ConnectionPlaces::Place place, tcp::socket socket, std::string address)
      : shared_(shared),
        id_(place.id),
        counted_(std::make_unique<Counted>(shared, place)),
        socket_(std::move(socket)),
        address_(std::move(address)) {
    shared_.connections[id_] = this;
  }
  ~Connection() { shared_.connections.erase(id_); }
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;

  /// Ends the operation under way, which ends the connection.
  void close() { socket_.close(); }

  /// One time limit for the whole request, however slowly its bytes come.
  void read() {
    parser_.emplace();
    parser_->header_limit(WebServer::kMostHeaderBytes);
    // No limit as yet, for what has too large a body gets an answer; Beast takes none at all for
    // zero.
    parser_->body_limit(std::numeric_limits<uint64_t>::max());
    parser_->eager(false);
    socket_.expires_after(shared_.limits.request_within);
    http::async_read_header(socket_, buffer_, *parser_,
                            [self = shared_from_this()](error_code error, size_t) {
                              if (!error && self->is_open()) self->take_header();
                            });
  }

 private:
  /// False after close(): an operation that had succeeded just before is then ignored.
  bool is_open() const { return socket_.socket().is_open(); }

  /// The first bytes of a request may take longer than the request.
  void read_next() {
    if (buffer_.size() > 0) return read();
    socket_.expires_after(kIdleFor);
    socket_.async_read_some(buffer_.prepare(WebServer::kMostHeaderBytes),
                            [self = shared_from_this()](error_code error, size_t bytes) {
                              if (error || !self->is_open()) return;
                              self->buffer_.commit(bytes);
                              self->read();
                            });
  }

  /// Only a POST has a body that is read, and only a short one. Any other would be taken for the
  /// next request: the connection ends with the answer.
  void take_header() {
    const Request& request = parser_->get();
    const auto size = parser_->content_length();
    const bool has_body = parser_->chunked() || (size && *size > 0);
    keep_alive_ = request.keep_alive() && !has_body;
    if (!has_body) return take(false);
    if (request.method() != http::verb::post || parser_->chunked() ||
        *size > WebServer::kMostBodyBytes) {
      return take(true);
    }
    parser_->body_limit(WebServer::kMostBodyBytes);
    http::async_read(socket_, buffer_, *parser_,
                     [self = shared_from_this()](error_code error, size_t) {
                       if (!error && self->is_open()) self->take(false);
                     });
  }

  void take(bool has_unread_body) {
    const Request& request = parser_->get();
    WebSite& site = shared_.site;
    WebRequest asked = plain(request, address_);
    asked.has_unread_body = has_unread_body;
    const Visitor visitor = site.visitor(asked);
    shared_.places.set_visitor(id_, visitor);
    if (counted_->place().is_reserved) {
      keep_alive_ = false;  // the place is for the next operator
      if (visitor != Visitor::kOperator || websocket::is_upgrade(request)) {
        return answer(busy(), request.method() == http::verb::head);
      }
    }
    if (!websocket::is_upgrade(request)) {
      answer_or_work(site.answer(asked), request.method() == http::verb::head);
      return;
    }
    WebSite::Opening opening = site.open_stream(asked);
    if (!opening.stream) {
      answer(std::move(opening.refusal), false);
      return;
    }
    socket_.expires_never();
    std::make_shared<Watcher>(std::move(counted_), socket_.release_socket(),
                              shared_.watch(*opening.stream))
        ->begin(request);
  }

  void answer_or_work(WebAnswer first, bool head_only) {
    if (!first.work) return answer(std::move(first), head_only);
    const bool waits =
        shared_.defer(std::move(first), [self = shared_from_this(), head_only](WebAnswer made) {
          self->answer(std::move(made), head_only);
        });
    if (!waits) answer(busy(), head_only);
  }

  static WebAnswer busy() {
    return {.status = 503,
            .body = "too much is being asked for; try again\n",
            .fields = {{"Retry-After", "1"}}};
  }

  void answer(WebAnswer answer, bool head_only) {
    if (head_only || !answer.file) {
      http::response<http::string_body> response;
      set_head(response, answer, keep_alive_);
      response.body() = head_only ? "" : std::move(answer.body);
      const auto size = answer.file ? answer.file->size : static_cast<int64_t>(answer.body.size());
      if (head_only) {
        response.content_length(static_cast<uint64_t>(size));
      } else if (answer.status != 304) {
        response.prepare_payload();
      }
      send(std::move(response));
      return;
    }
    http::response<FilePartBody> response;
    set_head(response, answer, keep_alive_);
    response.content_length(static_cast<uint64_t>(answer.file->size));
    response.body() = std::move(*answer.file);
    send(std::move(response));
  }

  template <class Body>
  void send(http::response<Body> response) {
    // They live until the last byte has gone; the serializer refers to the response.
    struct Sending {
      explicit Sending(http::response<Body> from)
          : response(std::move(from)), serializer(response) {}
      http::response<Body> response;
      http::response_serializer<Body> serializer;
    };
    send_some(std::make_shared<Sending>(std::move(response)));
  }

  /// In pieces, each within its time: a large file takes long on a slow line.
  template <class Sending>
  void send_some(const std::shared_ptr<Sending>& sending) {
    socket_.expires_after(kSendWithin);
    http::async_write_some(socket_, sending->serializer,
                           [self = shared_from_this(), sending](error_code error, size_t) {
                             if (error) return;
                             if (!sending->serializer.is_done()) return self->send_some(sending);
                             self->after_answer();
                           });
  }

  void after_answer() {
    if (keep_alive_) return read_next();
    error_code ignored;
    socket_.socket().shutdown(tcp::socket::shutdown_send, ignored);
  }

  Shared& shared_;
  const ConnectionPlaces::Id id_;
  std::unique_ptr<Counted> counted_;
  beast::tcp_stream socket_;
  beast::flat_buffer buffer_;
  boost::optional<http::request_parser<http::string_body>> parser_;
  const std::string address_;
  bool keep_alive_ = false;
};

}  // namespace

class WebServer::Impl {
 public:
  Impl(const WebAddress& address, WebSite& site, Watch watch, const WebLimits& limits)
      : shared_{.site = site,
                .watch = std::move(watch),
                .limits = limits,
                .defer = [this](auto answer,
                                auto done) { return defer(std::move(answer), std::move(done)); }},
        acceptor_(io_) {
    const tcp::endpoint here(asio::ip::make_address(address.host), address.port);
    error_code error;
    acceptor_.open(here.protocol(), error);
    if (!error) acceptor_.set_option(asio::socket_base::reuse_address(true), error);
    if (!error) acceptor_.bind(here, error);
    if (!error) acceptor_.listen(asio::socket_base::max_listen_connections, error);
    if (error) {
      throw InputError("viewer.listen: cannot listen on " + address.host + ":" +
                       std::to_string(address.port) + ": " + error.message());
    }
    accept();
    thread_ = std::thread([this] { run(); });
  }

  ~Impl() {
    io_.stop();
    thread_.join();
    worker_.stop();
    worker_.join();
  }

  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  uint16_t port() const { return acceptor_.local_endpoint().port(); }

  void run_inside(const std::function<void(int64_t)>& work) {
    std::packaged_task<void()> task([&] {
      work(static_cast<int64_t>(shared_.watchers.size()));
      for (Watcher* watcher : shared_.watchers) watcher->send();
    });
    auto done = task.get_future();
    asio::post(io_, [&task] { task(); });
    done.get();
  }

 private:
  /// One connection that went wrong does not end the others.
  void run() {
    while (!io_.stopped()) {
      try {
        io_.run();
      } catch (const std::exception& error) {
        spdlog::error("a connection ended: {}", error.what());
      }
    }
  }

  bool defer(WebAnswer answer, std::function<void(WebAnswer)> done) {
    if (!answer.listing.empty()) {
      return listings_.run(answer.listing, std::move(answer.work), std::move(done));
    }
    if (deferred_ >= kMostDeferred) return false;
    ++deferred_;
    asio::post(worker_, [this, work = std::move(answer.work), done = std::move(done)]() mutable {
      asio::post(io_, [this, done = std::move(done), answer = work()]() mutable {
        --deferred_;
        done(std::move(answer));
      });
    });
    return true;
  }

  void accept() {
    acceptor_.async_accept([this](error_code error, tcp::socket socket) {
      if (error) return accept_later(error);
      if (std::exchange(accept_failed_, false)) spdlog::info("connections are taken again");
      enter(std::move(socket));
      accept();
    });
  }

  void enter(tcp::socket socket) {
    error_code ignored;
    socket.set_option(tcp::no_delay(true), ignored);
    const std::string from = socket.remote_endpoint(ignored).address().to_string();
    const auto place = shared_.places.enter(from);
    if (!place) return;
    if (place->replaced) {
      const auto replaced = shared_.connections.find(*place->replaced);
      if (replaced != shared_.connections.end()) replaced->second->close();
    }
    std::make_shared<Connection>(shared_, *place, std::move(socket), from)->read();
  }

  /// Who could not be taken still waits: with no descriptor left, to ask again at once would fail
  /// at once.
  void accept_later(error_code error) {
    if (error == asio::error::operation_aborted) return;
    if (!std::exchange(accept_failed_, true)) {
      spdlog::warn("cannot take a connection: {}; trying again until it can be", error.message());
    }
    spdlog::debug("a connection was not taken");
    accept_again_.expires_after(kAcceptAgain);
    accept_again_.async_wait([this](error_code stopped) {
      if (!stopped) accept();
    });
  }

  Shared shared_;  ///< outlives what is in io_
  asio::io_context io_{1};
  tcp::acceptor acceptor_;
  asio::steady_timer accept_again_{io_};
  bool accept_failed_ = false;
  std::thread thread_;
  int deferred_ = 0;  ///< the server's thread only
  asio::thread_pool worker_{1};
  ListingRunner listings_{io_, shared_.limits.listing_within};
};

WebServer::WebServer(const WebAddress& address, WebSite& site, Watch watch, const WebLimits& limits)
    : impl_(std::make_unique<Impl>(address, site, std::move(watch), limits)) {}
WebServer::~WebServer() = default;
uint16_t WebServer::port() const { return impl_->port(); }
void WebServer::run_inside(const std::function<void(int64_t)>& work) { impl_->run_inside(work); }

}  // namespace v3d
