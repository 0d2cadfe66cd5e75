#include "daemon/web/web_server.h"

#include <netinet/in.h>
#include <spdlog/spdlog.h>
#include <sys/socket.h>

#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/steady_timer.hpp>
#include <cerrno>
#include <future>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>

#include "base/core/error.h"
#include "daemon/web/web_connection.h"
#include "daemon/web/work_runner.h"

namespace v3d::web {
namespace {

namespace asio = boost::asio;
using asio::ip::tcp;
using boost::system::error_code;

constexpr std::chrono::milliseconds kAcceptRetryDelay{100};
/// A connection waits for one work at most, so this many are enough for all while the disk works.
constexpr size_t kMaxFileReads = ConnectionSlots::kMaxCommon + ConnectionSlots::kReserved;
constexpr char kLateFile[] = "the disk is slow; try again";

std::string text_of(const WebAddress& address) {
  return address.host + ":" + std::to_string(address.port);
}

/// Binds also to an address that no interface has yet. A PC can get its address after its daemons
/// have started: from DHCP, or when the switch starts later than the PC.
void bind_to(tcp::acceptor& acceptor, const tcp::endpoint& endpoint, const WebAddress& address,
             error_code& error) {
  acceptor.bind(endpoint, error);
  if (error.value() != EADDRNOTAVAIL) return;
  const bool is_v6 = endpoint.address().is_v6();
  const int level = is_v6 ? IPPROTO_IPV6 : IPPROTO_IP;
  const int option = is_v6 ? IPV6_FREEBIND : IP_FREEBIND;
  const int on = 1;
  if (setsockopt(acceptor.native_handle(), level, option, &on, sizeof on) != 0) return;
  acceptor.bind(endpoint, error);
  if (error) return;
  spdlog::warn("{}: no interface has the address of {} now; connections are accepted when one has",
               address.field, text_of(address));
}

[[noreturn]] void fail_to_listen(const WebAddress& address, const error_code& error) {
  const std::string text =
      address.field + ": cannot listen on " + text_of(address) + ": " + error.message();
  // Not an InputError: the other program may end, so a daemon must be started again.
  if (error.value() == EADDRINUSE) throw std::runtime_error(text);
  throw InputError(text);
}

}  // namespace

class WebServer::Impl {
 public:
  Impl(const WebAddress& address, WebHandler& handler, const WebLimits& limits)
      : connections_{.handler = handler,
                     .limits = limits,
                     .defer =
                         [this](auto response, auto done) {
                           return defer(std::move(response), std::move(done));
                         }},
        acceptor_(io_) {
    const tcp::endpoint endpoint(asio::ip::make_address(address.host), address.port);
    error_code error;
    acceptor_.open(endpoint.protocol(), error);
    if (!error) acceptor_.set_option(asio::socket_base::reuse_address(true), error);
    if (!error) bind_to(acceptor_, endpoint, address, error);
    if (!error) acceptor_.listen(asio::socket_base::max_listen_connections, error);
    if (error) fail_to_listen(address, error);
    accept();
    thread_ = std::thread([this] { run(); });
  }

  ~Impl() {
    io_.stop();
    thread_.join();
  }

  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  uint16_t port() const { return acceptor_.local_endpoint().port(); }

  void run_on_thread(const std::function<void(int64_t)>& work) {
    std::packaged_task<void()> task([&] {
      work(static_cast<int64_t>(connections_.subscribers.size()));
      for (WebSubscriber* subscriber : connections_.subscribers) subscriber->send();
    });
    auto done = task.get_future();
    asio::post(io_, [&task] { task(); });
    done.get();
  }

  void start_work(WebResponse response) {
    asio::post(io_, [this, response = std::move(response)] {
      defer(response, [](const WebResponse&) {});
    });
  }

 private:
  /// An exception ends one connection, not the others.
  void run() {
    while (!io_.stopped()) {
      try {
        io_.run();
      } catch (const std::exception& error) {
        spdlog::error("a connection ended: {}", error.what());
      }
    }
  }

  bool defer(WebResponse response, std::function<void(WebResponse)> done) {
    return runner_of(response.kind)
        .run(response.listing, std::move(response.work), std::move(done));
  }

  WorkRunner& runner_of(WorkKind kind) {
    switch (kind) {
      case WorkKind::kListing:
        return listings_;
      case WorkKind::kPicture:
        return pictures_;
      case WorkKind::kThumbnail:
        return thumbnails_;
      case WorkKind::kPage:
        return pages_;
      case WorkKind::kFile:
        break;
    }
    return files_;
  }

  void accept() {
    acceptor_.async_accept([this](error_code error, tcp::socket socket) {
      if (error) return accept_later(error);
      if (std::exchange(accept_failed_, false)) spdlog::info("connections are accepted again");
      open_connection(std::move(socket));
      accept();
    });
  }

  void open_connection(tcp::socket socket) {
    error_code ignored;
    socket.set_option(tcp::no_delay(true), ignored);
    const std::string from = socket.remote_endpoint(ignored).address().to_string();
    const auto slot = connections_.slots.acquire(from);
    if (!slot) return;
    if (slot->replaced) {
      const auto replaced = connections_.open.find(*slot->replaced);
      if (replaced != connections_.open.end()) replaced->second->close();
    }
    std::make_shared<WebConnection>(connections_, *slot, std::move(socket), from)->read();
  }

  /// Retries after kAcceptRetryDelay. The connection still waits, so that without free file
  /// descriptors an immediate retry would fail at once.
  void accept_later(error_code error) {
    if (error == asio::error::operation_aborted) return;
    if (!std::exchange(accept_failed_, true)) {
      spdlog::warn("cannot accept a connection: {}; trying again", error.message());
    }
    spdlog::debug("a connection was not accepted");
    accept_retry_.expires_after(kAcceptRetryDelay);
    accept_retry_.async_wait([this](error_code stopped) {
      if (!stopped) accept();
    });
  }

  WebConnections connections_;  ///< must outlive the handlers in io_
  asio::io_context io_{1};
  tcp::acceptor acceptor_;
  asio::steady_timer accept_retry_{io_};
  bool accept_failed_ = false;
  std::thread thread_;
  WorkRunner listings_{io_,
                       {.timeout = connections_.limits.disk_timeout,
                        .late = "the disk is slow to list its folders; try again"}};
  WorkRunner pictures_{io_, {.timeout = connections_.limits.picture_timeout, .late = kLateFile}};
  WorkRunner thumbnails_{io_, {.timeout = connections_.limits.picture_timeout, .late = kLateFile}};
  WorkRunner files_{io_,
                    {.threads = 4,
                     .max_waiting = kMaxFileReads,
                     .timeout = connections_.limits.disk_timeout,
                     .late = kLateFile}};
  WorkRunner pages_{io_,
                    {.max_waiting = kMaxFileReads,
                     .timeout = connections_.limits.disk_timeout,
                     .late = kLateFile}};
};

WebServer::WebServer(const WebAddress& address, WebHandler& handler, const WebLimits& limits)
    : impl_(std::make_unique<Impl>(address, handler, limits)) {}
WebServer::~WebServer() = default;
uint16_t WebServer::port() const { return impl_->port(); }
void WebServer::run_on_thread(const std::function<void(int64_t)>& work) {
  impl_->run_on_thread(work);
}
void WebServer::start_work(WebResponse response) { impl_->start_work(std::move(response)); }

}  // namespace v3d::web
