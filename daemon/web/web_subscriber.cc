#include "daemon/web/web_subscriber.h"

#include <charconv>
#include <chrono>
#include <nlohmann/json.hpp>
#include <string_view>
#include <utility>

#include "base/core/time.h"

namespace v3d {
namespace {

namespace asio = boost::asio;
namespace websocket = boost::beast::websocket;
using boost::system::error_code;

constexpr std::chrono::seconds kHandshakeTimeout{30};
constexpr std::chrono::seconds kSubscriberTimeout{20};
constexpr size_t kMaxReceivedBytes = 256;
/// Send buffer in the kernel: a few frames, to bound the latency.
constexpr int kSendBuffer = 256 << 10;

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

}  // namespace v3d
