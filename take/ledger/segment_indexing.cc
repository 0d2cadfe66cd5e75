#include "take/ledger/segment_indexing.h"

#include <cerrno>
#include <type_traits>

#include "take/logs/frame_log.h"
#include "take/logs/log_files.h"

namespace v3d::take {
namespace {

/// True when an event is a whole message. Reads the data only if such a message can have this
/// length. Fails on read errors.
template <class Message>
io::Result<bool> is_whole(const EventLogReader& log, const EventSpan& event) {
  if constexpr (std::is_same_v<Message, wire::PulseMessage>) {
    if (event.data_size > kMaxPulseBytes) return false;
  } else {
    const auto head = read_head(log, event);
    if (!head) return tl::make_unexpected(head.error());
    if (!*head) return false;
  }
  const auto message = read_message<Message>(log, event);
  if (!message) return tl::make_unexpected(message.error());
  return message->has_value();
}

/// Builds the index of segment `number`. Fails on read errors.
///
/// After a power cut, the last events can have their length but not their bytes; such events are
/// not counted. Events are checked from the end, at most kMaxUnwrittenBytes back: earlier damage
/// has another cause and stays in the log.
template <class Message>
io::Result<SegmentIndex> index_of(const EventLogReader& log, uint32_t number) {
  constexpr uint64_t kMaxUnwrittenBytes = 64 << 20;
  const LogSegment& segment = log.segments()[number];
  SegmentIndex index{.bytes = segment.bytes,
                     .whole_bytes = 0,
                     .events = segment.events,
                     .damaged_places = segment.damaged_places};
  uint64_t end = 0;
  int64_t skipped = 0;
  for (auto event = log.events().rbegin(); event != log.events().rend(); ++event) {
    if (event->segment != number) continue;
    const uint64_t event_end = event->data_offset + event->data_size;
    if (end == 0) end = index.whole_bytes = event_end;
    if (end - event_end > kMaxUnwrittenBytes) return index;
    const auto whole = is_whole<Message>(log, *event);
    if (!whole) return tl::make_unexpected(whole.error());
    if (*whole) {
      index.whole_bytes = event_end;
      index.events -= skipped;
      return index;
    }
    ++skipped;
  }
  return index;
}

}  // namespace

io::Result<std::optional<wire::FrameHead>> read_head(const EventLogReader& log,
                                                     const EventSpan& event) {
  const auto begin = log.read(event, wire::kFrameHeadSize);
  if (!begin) return tl::make_unexpected(begin.error());
  auto head = wire::decode_frame_head(*begin);
  return head && head->message_size == event.data_size ? std::move(head) : std::nullopt;
}

template <class Message>
io::Status index_segments(const std::filesystem::path& path, IndexProblems& problems,
                          const ReadProgress& progress) {
  if (is_absent_log(path)) return {};  // the verification reports it
  const auto log = EventLogReader::open(path, progress);
  if (!log) return tl::make_unexpected(log.error());
  for (uint32_t number = 0; number < log->segments().size(); ++number) {
    const LogSegment& segment = log->segments()[number];
    // Sync the log before the ledger: after a power cut, the ledger must not list events that the
    // log has lost.
    if (auto synced = segment.file.sync(); !synced) return synced;
    if (segment.index) continue;
    if (!segment.index_error.empty()) {
      problems.notes.push_back(segment.index_error + "; the index was made again");
    }
    io::Result<SegmentIndex> index =
        tl::make_unexpected(io::IoError{.code = EIO, .message = segment.read_error});
    if (segment.read_error.empty()) index = index_of<Message>(*log, number);
    if (!index) {
      problems.read_errors.push_back(index.error().message);
    } else if (auto saved = save_segment_index(segment.file.path(), *index); !saved) {
      return saved;
    }
  }
  return {};
}

template io::Status index_segments<wire::PulseMessage>(const std::filesystem::path&, IndexProblems&,
                                                       const ReadProgress&);
template io::Status index_segments<wire::FrameMessage>(const std::filesystem::path&, IndexProblems&,
                                                       const ReadProgress&);

}  // namespace v3d::take
