// LCM event logs, read without trust. LCM's own reader allocates whatever a damaged length says and
// reads every byte to find the next event; takes are tens of gigabytes and may end in the middle of
// an event.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "wire/codec.h"

namespace v3d {

inline constexpr uint32_t kEventSyncWord = 0xEDA1DA01;
inline constexpr size_t kEventHeaderSize = 28;  ///< before the channel's name

/// Where one event lies in the file.
struct EventSpan {
  std::string channel;
  int64_t utime = 0;  ///< microseconds since 1970
  uint64_t data_offset = 0;
  uint32_t data_size = 0;
};

/// The events of one log by position. Reads headers only; one thread.
class EventLogReader {
 public:
  /// Throws InputError when the file cannot be opened, or holds bytes but no whole event. An empty
  /// file is a log without events.
  explicit EventLogReader(const std::filesystem::path& path);
  ~EventLogReader();
  EventLogReader(EventLogReader&& other) noexcept;
  EventLogReader& operator=(EventLogReader&& other) noexcept;

  const std::vector<EventSpan>& events() const { return events_; }
  /// Places inside the file where something else stood than an event.
  int64_t damaged_places() const { return damaged_places_; }
  /// Bytes behind the last whole event.
  int64_t torn_bytes() const { return torn_bytes_; }
  /// The first `limit` bytes of an event's data, fewer when the disk refuses.
  Bytes read(const EventSpan& event, size_t limit = SIZE_MAX) const;

 private:
  void index(uint64_t file_size);

  int fd_ = -1;
  std::vector<EventSpan> events_;
  int64_t damaged_places_ = 0;
  int64_t torn_bytes_ = 0;
};

}  // namespace v3d
