#include "take/event_log.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <optional>
#include <utility>

#include "base/error.h"

namespace v3d {
namespace {

// An event, as LCM's documentation of log files gives it, all numbers big-endian: sync word, event
// number (8 bytes), time (8), length of the channel's name (4), length of the data (4), name, data.
constexpr size_t kLongestChannel = 63;  // LCM_MAX_CHANNEL_NAME_LENGTH

uint64_t big_endian(const uint8_t* p, int bytes) {
  uint64_t n = 0;
  for (int i = 0; i < bytes; ++i) n = n << 8 | p[i];
  return n;
}

/// As many of the bytes as there are.
size_t read_at(int fd, uint64_t offset, std::span<uint8_t> bytes) {
  size_t done = 0;
  while (done < bytes.size()) {
    const ssize_t n =
        pread(fd, bytes.data() + done, bytes.size() - done, static_cast<off_t>(offset + done));
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) break;
    done += static_cast<size_t>(n);
  }
  return done;
}

/// The event whose header is at `offset`, if a whole one is.
std::optional<EventSpan> event_at(int fd, uint64_t offset, uint64_t file_size) {
  std::array<uint8_t, kEventHeaderSize + kLongestChannel> head{};
  const size_t got = read_at(fd, offset, head);
  if (got < kEventHeaderSize || big_endian(head.data(), 4) != kEventSyncWord) return std::nullopt;
  const uint64_t channel_size = big_endian(head.data() + 20, 4);
  const uint64_t data_size = big_endian(head.data() + 24, 4);
  if (channel_size == 0 || channel_size > kLongestChannel || data_size > INT32_MAX) {
    return std::nullopt;
  }
  const uint64_t data_offset = offset + kEventHeaderSize + channel_size;
  if (data_offset > file_size || data_size > file_size - data_offset) return std::nullopt;
  return EventSpan{.channel = std::string(
                       head.begin() + kEventHeaderSize,
                       head.begin() + kEventHeaderSize + static_cast<ptrdiff_t>(channel_size)),
                   .utime = static_cast<int64_t>(big_endian(head.data() + 12, 8)),
                   .data_offset = data_offset,
                   .data_size = static_cast<uint32_t>(data_size)};
}

uint64_t end_of(const EventSpan& event) { return event.data_offset + event.data_size; }

/// The first place from `from` on, and before `until`, where a whole event begins.
std::optional<uint64_t> next_event(int fd, uint64_t from, uint64_t until, uint64_t file_size) {
  constexpr std::array<uint8_t, 4> kSync = {0xED, 0xA1, 0xDA, 0x01};
  std::vector<uint8_t> chunk(1 << 16);
  while (from < until) {
    const size_t got = read_at(fd, from, chunk);
    if (got < kSync.size()) break;
    const uint8_t* const stop = chunk.data() + got;
    for (const uint8_t* at = chunk.data();;) {
      at = static_cast<const uint8_t*>(
          memmem(at, static_cast<size_t>(stop - at), kSync.data(), kSync.size()));
      if (at == nullptr) break;
      const uint64_t offset = from + static_cast<uint64_t>(at - chunk.data());
      if (offset >= until) return std::nullopt;
      if (event_at(fd, offset, file_size)) return offset;
      ++at;
    }
    from += got - (kSync.size() - 1);
  }
  return std::nullopt;
}

}  // namespace

EventLogReader::EventLogReader(const std::filesystem::path& path)
    : fd_(open(path.c_str(), O_RDONLY | O_CLOEXEC)) {
  if (fd_ < 0) throw InputError(errno_message("cannot open log " + path.string()));
  struct stat status {};
  const bool is_file = fstat(fd_, &status) == 0 && S_ISREG(status.st_mode);
  if (is_file) index(static_cast<uint64_t>(status.st_size));
  if (!is_file || (events_.empty() && torn_bytes_ > static_cast<int64_t>(kEventHeaderSize))) {
    close(fd_);
    throw InputError(path.string() + ": is no LCM event log: it holds no whole event");
  }
}

EventLogReader::~EventLogReader() {
  if (fd_ >= 0) close(fd_);
}

EventLogReader::EventLogReader(EventLogReader&& other) noexcept
    : fd_(std::exchange(other.fd_, -1)),
      events_(std::move(other.events_)),
      damaged_places_(other.damaged_places_),
      torn_bytes_(other.torn_bytes_) {}

EventLogReader& EventLogReader::operator=(EventLogReader&& other) noexcept {
  std::swap(fd_, other.fd_);
  events_ = std::move(other.events_);
  damaged_places_ = other.damaged_places_;
  torn_bytes_ = other.torn_bytes_;
  return *this;
}

void EventLogReader::index(uint64_t file_size) {
  uint64_t offset = 0;
  auto event = event_at(fd_, offset, file_size);
  while (offset < file_size) {
    auto behind = event ? event_at(fd_, end_of(*event), file_size) : std::nullopt;
    // Where nothing right follows, an event may have a damaged length, and hold others.
    const bool is_sure = event && (behind || end_of(*event) == file_size);
    const uint64_t until = event ? end_of(*event) : file_size;
    const auto next = is_sure ? std::nullopt : next_event(fd_, offset + 1, until, file_size);
    if (event && !next) {
      offset = end_of(*event);
      events_.push_back(*std::exchange(event, std::move(behind)));
      continue;
    }
    if (!next) break;
    ++damaged_places_;
    offset = *next;
    event = event_at(fd_, offset, file_size);
  }
  torn_bytes_ = static_cast<int64_t>(file_size - offset);
}

Bytes EventLogReader::read(const EventSpan& event, size_t limit) const {
  Bytes bytes(std::min<size_t>(event.data_size, limit));
  bytes.resize(read_at(fd_, event.data_offset, bytes));
  return bytes;
}

}  // namespace v3d
