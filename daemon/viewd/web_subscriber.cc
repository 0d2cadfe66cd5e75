#include "daemon/viewd/web_subscriber.h"

#include <charconv>
#include <chrono>
#include <string_view>
#include <utility>

#include "base/time.h"
#include "daemon/viewd/view_json.h"

namespace v3d {
namespace {

namespace asio = boost::asio;
namespace websocket = boost::beast::websocket;
using boost::system::error_code;

constexpr std::chrono::seconds kHandshakeWithin{30};
constexpr std::chrono::seconds kSilentFor{20};
constexpr size_t kMaxReceivedBytes = 256;
/// What the kernel may hold for one who watches: some frames, or live would not be live.
constexpr int kSendBuffer = 256 << 10;

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

}  // namespace

WebSubscriber::WebSubscriber(std::unique_ptr<ConnectionSlot> place, asio::ip::tcp::socket socket,
                             std::unique_ptr<WebStream> stream)
    : place_(std::move(place)), socket_(std::move(socket)), stream_(std::move(stream)) {}

WebSubscriber::~WebSubscriber() { place_->all().watchers.erase(this); }

void WebSubscriber::begin(const Request& request) {
  error_code ignored;
  socket_.next_layer().socket().set_option(asio::socket_base::send_buffer_size(kSendBuffer),
                                           ignored);
  websocket::stream_base::timeout limits{};
  limits.handshake_timeout = kHandshakeWithin;
  limits.idle_timeout = kSilentFor;
  limits.keep_alive_pings = true;
  socket_.set_option(limits);
  socket_.read_message_max(kMaxReceivedBytes);
  socket_.async_accept(request, [self = shared_from_this()](error_code error) {
    if (error) return;
    self->place_->all().watchers.insert(self.get());
    self->read();
    self->send();
  });
}

void WebSubscriber::send() {
  if (under_way_.bytes != nullptr) return;
  auto message = next();
  if (!message) return;
  under_way_ = std::move(*message);
  socket_.text(under_way_.is_text);
  socket_.async_write(asio::buffer(*under_way_.bytes),
                      [self = shared_from_this()](error_code error, size_t /*bytes*/) {
                        self->under_way_ = {};
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
      self->ping_ = ping;  // of several only the last is answered
    }
    self->received_.consume(self->received_.size());
    self->send();
    self->read();
  });
}

}  // namespace v3d
