// What the connections of a web server share: the site, their places, and who watches.
#pragma once

#include <functional>
#include <map>
#include <set>

#include "daemon/viewd/connection_slots.h"
#include "daemon/viewd/web_server.h"
#include "daemon/viewd/web_site.h"

namespace v3d {

class WebConnection;
class WebSubscriber;

/// The server's thread only.
struct WebConnections {
  WebSite& site;
  WebServer::Watch watch;
  WebLimits limits;
  ConnectionSlots places = {};
  std::map<ConnectionSlots::Id, WebConnection*> open = {};
  std::set<WebSubscriber*> watchers = {};
  /// Does the work of an answer on the thread for it, then calls `done` on the server's. False when
  /// too much waits there.
  std::function<bool(WebAnswer answer, std::function<void(WebAnswer)> done)> defer;
};

/// The place of a connection, until it is destroyed.
class ConnectionSlot {
 public:
  ConnectionSlot(WebConnections& all, ConnectionSlots::Place place) : all_(all), place_(place) {}
  ~ConnectionSlot() { all_.places.leave(place_.id); }
  ConnectionSlot(const ConnectionSlot&) = delete;
  ConnectionSlot& operator=(const ConnectionSlot&) = delete;
  WebConnections& all() const { return all_; }
  bool is_reserved() const { return place_.is_reserved; }

 private:
  WebConnections& all_;
  const ConnectionSlots::Place place_;
};

}  // namespace v3d
