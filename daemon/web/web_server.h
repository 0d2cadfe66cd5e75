// The HTTP and WebSocket server. Boost.Beast is confined to web_server.cc and
// web_connection.{h,cc}.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>

#include "daemon/web/web_access.h"
#include "daemon/web/web_message.h"

namespace v3d::web {

struct WebLimits {
  /// From the first byte of a request (for the first request: from the connection) to its last
  /// byte.
  std::chrono::nanoseconds request_timeout = std::chrono::seconds(5);
  /// After this time, a request that waits for a disk gets 503, and a file that is being sent ends.
  std::chrono::nanoseconds disk_timeout = std::chrono::seconds(10);
  /// After this time, a request for a picture gets 503.
  std::chrono::nanoseconds picture_timeout = std::chrono::seconds(60);
  /// Whether a connection may send several requests.
  bool keeps_alive = true;
};

/// Responds to requests and feeds WebSockets on one thread.
///
/// Each WebSocket has one message in flight, and gets the next one (WebStream::next()) when that
/// was sent. So nothing is queued for slow clients, and little in the kernel. The thread reads from
/// no disk: work (WebResponse::work) and the parts of files that are sent run on other threads, by
/// their kind (work_runner.h), so that they delay no other requests and no WebSocket.
///
/// Bounded: connections (connection_slots.h), size of header and body of a request, size of
/// messages from WebSockets, duration of requests and idle connections, and waiting work (more gets
/// 503).
class WebServer {
 public:
  static constexpr int kMaxHeaderBytes = 8192;
  static constexpr uint64_t kMaxBodyBytes = 4096;

  /// `handler` must outlive the server, and is used on its thread only. Port 0 selects a free port.
  /// Also listens on an address that no interface has yet, with a warning in the log. Throws
  /// std::runtime_error while another program listens there, and InputError if the server may not
  /// listen on the address.
  WebServer(const WebAddress& address, WebHandler& handler, const WebLimits& limits = {});
  ~WebServer();
  WebServer(const WebServer&) = delete;
  WebServer& operator=(const WebServer&) = delete;

  uint16_t port() const;
  /// Runs `work` on the server's thread, sends new messages to the subscribers, and returns.
  /// Blocking keeps the caller from queueing work faster than it is done.
  void run_on_thread(const std::function<void(int64_t subscribers)>& work);
  /// Runs the work of `response` as for a request, and drops its result. Returns at once. Any
  /// thread.
  void start_work(WebResponse response);

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace v3d::web
