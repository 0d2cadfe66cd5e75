// Limits of concurrent connections: which connection is accepted, and which one is closed for it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <list>
#include <optional>
#include <string>

#include "daemon/web/web_message.h"

namespace v3d::web {

/// Bounded table of connections: kMaxCommon for all clients, kMaxPerAddress of them for one
/// address, and kReserved for requests with the operators' token.
///
/// If the common slots, or those of the address, are used, a new connection replaces the oldest
/// unauthenticated one. So connections without a whole request cannot keep clients out. If all
/// are viewers, the new connection gets a reserved slot, on which the server answers only requests
/// of operators. One thread.
class ConnectionSlots {
 public:
  static constexpr size_t kMaxCommon = 128;
  static constexpr size_t kMaxPerAddress = 64;
  static constexpr size_t kReserved = 16;

  using Id = uint64_t;
  struct Slot {
    Id id = 0;
    bool is_reserved = false;
    std::optional<Id> replaced = {};  ///< the connection to close; its slot is free already
  };

  /// A slot for a new, unauthenticated connection. Empty: close the connection at once.
  std::optional<Slot> acquire(const std::string& address);
  /// Call it after each request. Does nothing if the connection was replaced.
  void set_role(Id id, ClientRole role);
  /// Frees the slot, unless the connection was replaced.
  void release(Id id);

  size_t size() const { return entries_.size(); }

 private:
  struct Entry {
    Id id = 0;
    std::string address;
    bool is_reserved = false;
    ClientRole role = ClientRole::kUnauthenticated;
  };
  template <class Matches>
  size_t count(Matches matches) const;
  /// Removes the oldest unauthenticated connection that matches.
  template <class Matches>
  std::optional<Id> remove_unauthenticated(Matches matches);
  Slot add(const std::string& address, bool is_reserved, std::optional<Id> replaced);

  std::list<Entry> entries_;  ///< oldest first
  Id last_id_ = 0;
};

}  // namespace v3d::web
