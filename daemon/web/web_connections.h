// State that the connections of a web server share: the handler, slots and subscribers.
#pragma once

#include <functional>
#include <map>
#include <set>

#include "daemon/web/connection_slots.h"
#include "daemon/web/web_handler.h"
#include "daemon/web/web_server.h"

namespace v3d {

class WebConnection;
class WebSubscriber;

/// Used on the server's thread only.
struct WebConnections {
  WebHandler& handler;
  WebLimits limits;
  ConnectionSlots slots = {};
  std::map<ConnectionSlots::Id, WebConnection*> open = {};
  std::set<WebSubscriber*> subscribers = {};
  /// Runs the work of an answer on a thread of its kind, then calls `done` on the server's thread.
  /// Returns false if too much work waits.
  std::function<bool(WebAnswer answer, std::function<void(WebAnswer)> done)> defer;
};

/// Holds the slot of a connection, and releases it on destruction.
class ConnectionSlot {
 public:
  ConnectionSlot(WebConnections& all, ConnectionSlots::Slot slot) : all_(all), slot_(slot) {}
  ~ConnectionSlot() { all_.slots.release(slot_.id); }
  ConnectionSlot(const ConnectionSlot&) = delete;
  ConnectionSlot& operator=(const ConnectionSlot&) = delete;
  WebConnections& all() const { return all_; }
  bool is_reserved() const { return slot_.is_reserved; }

 private:
  WebConnections& all_;
  const ConnectionSlots::Slot slot_;
};

}  // namespace v3d
