// The HTTP and WebSocket server. Boost.Beast is confined to web_server.cc, web_connection.h and
// web_subscriber.h.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>

#include "daemon/viewd/web_access.h"
#include "daemon/viewd/web_message.h"
#include "daemon/viewd/web_site.h"

namespace v3d {

struct WebLimits {
  /// From the first byte of a request (for the first request: from the connection) to its last
  /// byte.
  std::chrono::nanoseconds request_timeout = std::chrono::seconds(5);
  /// After this time, a request for a listing of folders gets 503.
  std::chrono::nanoseconds listing_timeout = std::chrono::seconds(10);
};

/// Answers requests and feeds WebSockets on one thread.
///
/// Each WebSocket has one message in flight, and gets the next one (WebStream::next()) when that
/// was sent. So nothing is queued for slow clients, and little in the kernel. Deferred work
/// (WebAnswer::work) runs on a second thread, one at a time, and listings on a third one
/// (listing_runner.h), so that they delay no other requests.
///
/// Bounded: connections (connection_slots.h), size of header and body of a request, size of
/// messages from WebSockets, duration of requests and idle connections, and waiting work (more gets
/// 503).
class WebServer {
 public:
  static constexpr int kMaxHeaderBytes = 8192;
  static constexpr uint64_t kMaxBodyBytes = 4096;
  static constexpr int kMaxDeferred = 64;

  using Subscribe = std::function<std::unique_ptr<WebStream>(WebSite::StreamKind)>;

  /// `site` and the objects that `subscribe` uses must outlive the server; they are used on its
  /// thread only. Throws InputError if it cannot listen on the address. Port 0 selects a free port.
  WebServer(const WebAddress& address, WebSite& site, Subscribe subscribe,
            const WebLimits& limits = {});
  ~WebServer();
  WebServer(const WebServer&) = delete;
  WebServer& operator=(const WebServer&) = delete;

  uint16_t port() const;
  /// Runs `work` on the server's thread, sends new messages to the subscribers, and returns.
  /// Blocking keeps the caller from queueing work faster than it is done.
  void run_on_thread(const std::function<void(int64_t subscribers)>& work);

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace v3d
