#include "take/logs/event_log.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <numeric>
#include <optional>
#include <utility>

#include "base/core/bytes.h"
#include "base/core/error.h"
#include "take/logs/log_files.h"

namespace v3d::take {
namespace {

// Layout of an event (LCM's documentation of log files), all numbers big-endian: sync word (4
// bytes), event number (8), time (8), length of the channel name (4), length of the data (4),
// channel name, data.
constexpr size_t kMaxLcmChannelSize = 63;  // LCM_MAX_CHANNEL_NAME_LENGTH
constexpr std::array<uint8_t, 4> kSyncBytes = {0xED, 0xA1, 0xDA, 0x01};

uint64_t end_of(const EventSpan& event) { return event.data_offset + event.data_size; }

/// Finds the events of one segment, and resynchronises after damaged bytes.
class SegmentScan {
 public:
  SegmentScan(LogSegment& segment, const ReadProgress& progress)
      : segment_(segment),
        progress_(progress),
        end_(segment.index ? segment.index->whole_bytes : segment.bytes) {}

  /// Appends the segment's events from `offset` on to `events`, and fills in the counts of
  /// LogSegment.
  void run(uint32_t number, uint64_t offset, std::vector<EventSpan>& events) {
    auto event = event_at(offset);
    while (offset < end_) {
      auto following = event ? event_at(end_of(*event)) : std::nullopt;
      // If no event follows, the length of this event may be damaged, and the event may contain
      // others.
      const bool is_certain = event && (following || end_of(*event) == end_);
      const uint64_t until = event ? end_of(*event) : end_;
      const auto next = is_certain ? std::nullopt : next_event(offset + 1, until);
      if (event && !next) {
        offset = end_of(*event);
        event->segment = number;
        events.push_back(*std::exchange(event, std::move(following)));
        ++segment_.events;
        continue;
      }
      if (!next) break;
      ++segment_.damaged_places;
      offset = *next;
      event = event_at(offset);
    }
    segment_.torn_bytes = end_ - std::min(offset, end_);
  }

  /// Passes events to `is_wanted` until it returns true: those from the middle on, then those from
  /// the start. `middle`: in bytes.
  bool find_from(uint64_t middle, const EventTest& is_wanted) {
    const auto first = event_at(0);
    // Frames of one camera have one size, so that an event starts at a multiple of it.
    if (first) middle -= middle % end_of(*first);
    return find(middle, end_, is_wanted) || find(0, middle, is_wanted);
  }

 private:
  bool find(uint64_t from, uint64_t until, const EventTest& is_wanted) {
    until = std::min(until, from + kMaxSearchedBytes);
    while (const auto offset = next_event(from, until)) {
      const auto event = event_at(*offset);
      if (event && is_wanted(segment_.file, *event)) return true;
      from = *offset + 1;  // the length of an unwanted event may be damaged
    }
    return false;
  }

  /// Reads up to `bytes.size()` bytes; 0 on a read error. Stores the first error.
  size_t read(uint64_t offset, std::span<uint8_t> bytes) {
    const auto got = segment_.file.read(offset, bytes);
    failed_ = !got;
    if (progress_) progress_();
    if (got) return *got;
    if (segment_.read_error.empty()) {
      segment_.read_error = got.error().message + " (at byte " + std::to_string(offset) + ")";
    }
    return 0;
  }

  /// The event whose header is at `offset`; empty when no whole event is there.
  std::optional<EventSpan> event_at(uint64_t offset) {
    std::array<uint8_t, kEventHeaderSize + kMaxChannelSize> bytes{};
    const std::span<const uint8_t> head(bytes);
    const size_t got = read(offset, bytes);
    if (got < kEventHeaderSize || read_big_endian(head.first(4)) != kEventSyncWord) {
      return std::nullopt;
    }
    const uint64_t channel_size = read_big_endian(head.subspan(20, 4));
    const uint64_t data_size = read_big_endian(head.subspan(24, 4));
    if (channel_size == 0 || channel_size > kMaxChannelSize || data_size > kMaxEventBytes) {
      return std::nullopt;
    }
    const uint64_t data_offset = offset + kEventHeaderSize + channel_size;
    if (data_offset > end_ || data_size > end_ - data_offset) return std::nullopt;
    const auto channel = head.subspan(kEventHeaderSize, channel_size);
    return EventSpan{.channel = std::string(channel.begin(), channel.end()),
                     .utime = static_cast<int64_t>(read_big_endian(head.subspan(12, 8))),
                     .data_offset = data_offset,
                     .data_size = static_cast<uint32_t>(data_size)};
  }

  /// Offset of the first whole event that starts in [from, until); empty when there is none. Skips
  /// unreadable blocks, in steps that double up to kMaxStep, so that the search of a failed disk
  /// ends.
  std::optional<uint64_t> next_event(uint64_t from, uint64_t until) {
    constexpr size_t kBlock = 4096;
    constexpr uint64_t kMaxStep = 1 << 20;
    std::vector<uint8_t> chunk(1 << 16);
    size_t size = chunk.size();
    for (uint64_t step = kBlock; (from = next_data(segment_.file, from)) < until;) {
      const size_t got = read(from, std::span(chunk).first(size));
      if (failed_ && size > kBlock) {
        size = kBlock;  // smaller blocks of it may be readable
      } else if (failed_) {
        from = from - from % kBlock + step;
        step = std::min(2 * step, kMaxStep);
      } else {
        if (got < kSyncBytes.size()) break;
        const auto found = event_in(std::span(chunk).first(got), from, until);
        if (found) return found;
        from += got - (kSyncBytes.size() - 1);
        size = chunk.size();
        step = kBlock;
      }
    }
    return std::nullopt;
  }

  /// Offset of the first event that starts in `bytes`, which have the offset `base`, and before
  /// `until`.
  std::optional<uint64_t> event_in(std::span<const uint8_t> bytes, uint64_t base, uint64_t until) {
    for (auto at = bytes.begin();; ++at) {
      at = std::search(at, bytes.end(), kSyncBytes.begin(), kSyncBytes.end());
      const uint64_t offset = base + static_cast<uint64_t>(at - bytes.begin());
      if (at == bytes.end() || offset >= until) return std::nullopt;
      if (event_at(offset)) return offset;
    }
  }

  LogSegment& segment_;
  const ReadProgress& progress_;
  const uint64_t end_;   ///< end of the searched bytes
  bool failed_ = false;  ///< the last read failed
};

/// True when the index of a recovery has no event, although the segment begins with an event whose
/// channel is longer than LCM permits. Earlier versions wrote such events and could not read them.
bool hides_long_channel(const SegmentIndex& index, const io::File& segment) {
  if (index.events > 0) return false;
  std::array<uint8_t, kEventHeaderSize> bytes{};
  const auto got = segment.read(0, bytes);
  const std::span<const uint8_t> head(bytes);
  return got && *got == bytes.size() && read_big_endian(head.first(4)) == kEventSyncWord &&
         read_big_endian(head.subspan(20, 4)) > kMaxLcmChannelSize;
}

io::Result<LogSegment> open_segment(const std::filesystem::path& path) {
  auto file = io::File::open(path, io::OpenMode::kReadWithinFolder);
  if (!file) return tl::make_unexpected(file.error());
  const auto bytes = file->size();
  if (!bytes) return tl::make_unexpected(bytes.error());
  auto index = load_segment_index(path, *bytes);
  if (index && *index && hides_long_channel(**index, *file)) {
    index = io::io_error("use", segment_index_path(path),
                         "an earlier version made it, which could not read the log");
  }
  return LogSegment{.file = *std::move(file),
                    .bytes = *bytes,
                    .index = index.value_or(std::nullopt),
                    .read_error = {},
                    .index_error = index ? std::string() : index.error().message};
}

}  // namespace

io::Result<EventLogReader> EventLogReader::open(const std::filesystem::path& log,
                                                const ReadProgress& progress, uint64_t from) {
  auto found = existing_segments(log);
  if (!found && found.error().code != ENOENT) return tl::make_unexpected(found.error());
  std::vector<std::filesystem::path> paths = found.value_or(std::vector<std::filesystem::path>());
  if (paths.empty()) paths.push_back(log);  // opening it reports the cause
  EventLogReader reader;
  for (const auto& path : paths) {
    auto segment = open_segment(path);
    if (!segment) return tl::make_unexpected(segment.error());
    reader.segments_.push_back(*std::move(segment));
    SegmentScan(reader.segments_.back(), progress)
        .run(static_cast<uint32_t>(reader.segments_.size() - 1), std::exchange(from, 0),
             reader.events_);
  }
  return reader;
}

EventLogReader::EventLogReader(const std::filesystem::path& log, const ReadProgress& progress,
                               uint64_t from)
    : EventLogReader(io::value_or_throw(open(log, progress, from))) {
  const std::vector<std::string> errors = read_errors();
  if (!events_.empty() || torn_bytes() <= static_cast<int64_t>(kEventHeaderSize)) return;
  throw InputError(errors.empty()
                       ? log.string() + ": is not an LCM event log: it holds no whole event"
                       : errors.front());
}

int64_t EventLogReader::damaged_places() const {
  return std::accumulate(segments_.begin(), segments_.end(), int64_t{0},
                         [](int64_t n, const LogSegment& s) { return n + s.damaged_places; });
}

int64_t EventLogReader::torn_bytes() const {
  return std::accumulate(
      segments_.begin(), segments_.end(), int64_t{0},
      [](int64_t n, const LogSegment& s) { return n + static_cast<int64_t>(s.torn_bytes); });
}

std::vector<std::string> EventLogReader::read_errors() const {
  std::vector<std::string> errors;
  for (const LogSegment& segment : segments_) {
    if (!segment.read_error.empty()) errors.push_back(segment.read_error);
  }
  return errors;
}

namespace {

struct LogPlace {
  size_t segment = 0;
  uint64_t offset = 0;
};

/// The middle byte of the log.
LogPlace middle_of(const std::vector<std::filesystem::path>& segments) {
  std::vector<uint64_t> sizes;
  for (const auto& path : segments) {
    std::error_code error;
    const uint64_t size = std::filesystem::file_size(path, error);
    sizes.push_back(error ? 0 : size);
  }
  uint64_t offset = std::accumulate(sizes.begin(), sizes.end(), uint64_t{0}) / 2;
  for (size_t n = 0; n < sizes.size(); ++n) {
    if (offset < sizes[n]) return {n, offset};
    offset -= sizes[n];
  }
  return {};
}

}  // namespace

io::Result<bool> find_middle_event(const std::filesystem::path& log, const EventTest& is_wanted) {
  const auto paths = existing_segments(log);
  if (!paths) return tl::make_unexpected(paths.error());
  const LogPlace middle = middle_of(*paths);
  io::Result<bool> result = io::io_error("open", log, "there is no such log", ENOENT);
  for (size_t n = 0; n < paths->size(); ++n) {
    auto segment = open_segment((*paths)[(middle.segment + n) % paths->size()]);
    if (!segment) {
      if (!result) result = tl::make_unexpected(segment.error());
      continue;
    }
    const bool found = SegmentScan(*segment, {}).find_from(n == 0 ? middle.offset : 0, is_wanted);
    if (found) return true;
    result = false;
  }
  return result;
}

io::Result<wire::Bytes> EventLogReader::read(const EventSpan& event, size_t limit) const {
  wire::Bytes bytes(std::min<size_t>(event.data_size, limit));
  const auto read = segments_[event.segment].file.read_whole(event.data_offset, bytes);
  if (!read) return tl::make_unexpected(read.error());
  return bytes;
}

}  // namespace v3d::take
