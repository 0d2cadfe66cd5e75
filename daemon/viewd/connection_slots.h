// Places for connections: which connection is accepted, and which one is closed for it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <list>
#include <optional>
#include <string>

namespace v3d {

/// Who has sent the last request of a connection.
enum class Visitor : uint8_t {
  kStranger,  ///< nobody yet, or a request that WebAccess refuses
  kViewer,    ///< a request that WebAccess admits
  kOperator   ///< the same, with the operators' token
};

/// Bounded table of connections: kMaxCommon for everybody, kMaxPerAddress of them for one address,
/// and kReserved for requests with the operators' token.
///
/// Where the common places, or those of the address, are taken, a new connection replaces the
/// oldest one of a stranger: connections that send nothing or half a request keep nobody out. Where
/// only viewers are left, the new connection gets a reserved place, and the server answers on it
/// only requests of operators. One thread.
class ConnectionSlots {
 public:
  static constexpr size_t kMaxCommon = 128;
  static constexpr size_t kMaxPerAddress = 64;
  static constexpr size_t kReserved = 16;

  using Id = uint64_t;
  struct Place {
    Id id = 0;
    bool is_reserved = false;
    std::optional<Id> replaced = {};  ///< the connection to close; its place is free already
  };

  /// A place for a new connection, of a stranger as yet; empty where it is to be closed at once.
  std::optional<Place> enter(const std::string& address);
  /// After each request. Nothing happens when the connection has been replaced.
  void set_visitor(Id id, Visitor visitor);
  /// Frees the place, unless the connection has been replaced.
  void leave(Id id);

  size_t size() const { return entries_.size(); }

 private:
  struct Entry {
    Id id = 0;
    std::string address;
    bool is_reserved = false;
    Visitor visitor = Visitor::kStranger;
  };
  template <class Matches>
  size_t count(Matches matches) const;
  /// Removes the oldest stranger that matches.
  template <class Matches>
  std::optional<Id> remove_stranger(Matches matches);
  Place add(const std::string& address, bool is_reserved, std::optional<Id> replaced);

  std::list<Entry> entries_;  ///< oldest first
  Id last_id_ = 0;
};

}  // namespace v3d
