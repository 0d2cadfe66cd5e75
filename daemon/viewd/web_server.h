// The server of HTTP and WebSocket: accepts connections. With web_connection.h and web_watcher.h
// it is the adapter of Boost.Beast; it knows sockets and no takes.
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
  /// From the first byte of a request (of the first one: from the connection) to its last byte.
  std::chrono::nanoseconds request_within = std::chrono::seconds(5);
  /// Until a request for a listing of folders is answered by 503.
  std::chrono::nanoseconds listing_within = std::chrono::seconds(10);
};

/// Answers requests and feeds WebSockets on one thread of its own. Each WebSocket has one message
/// under way at a time, and is asked for the next (WebStream::next) when that has gone: who is slow
/// makes nothing queue up here, and little in the kernel.
///
/// What takes long (WebAnswer::work) is done on a second thread, one after the other, and keeps
/// nobody waiting who asks for something else.
///
/// Listings of folders have a third thread (listing_runner.h).
///
/// Bounded whatever arrives: connections (connection_places.h), header and body of a request, what
/// a WebSocket may send, the time that a request and an idle connection may take, the work that
/// waits (more is answered by 503).
class WebServer {
 public:
  static constexpr int kMaxHeaderBytes = 8192;
  static constexpr uint64_t kMaxBodyBytes = 4096;
  static constexpr int kMaxDeferred = 64;

  using Watch = std::function<std::unique_ptr<WebStream>(WebSite::StreamKind)>;

  /// `site` and whatever `watch` reaches outlive the server, and are used on its thread alone.
  /// Throws InputError when nothing can listen there. Port 0 is any that is free.
  WebServer(const WebAddress& address, WebSite& site, Watch watch, const WebLimits& limits = {});
  ~WebServer();
  WebServer(const WebServer&) = delete;
  WebServer& operator=(const WebServer&) = delete;

  uint16_t port() const;
  /// Does `work` on the server's thread, then sends all who watch what is new; returns when it is
  /// done, so that whoever brings news cannot outrun it. `work` is told how many watch.
  void run_inside(const std::function<void(int64_t watchers)>& work);

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace v3d
