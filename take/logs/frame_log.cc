#include "take/logs/frame_log.h"

#include <fcntl.h>

#include <algorithm>
#include <cerrno>
#include <span>
#include <unordered_map>

#include "base/core/bytes.h"
#include "base/core/error.h"
#include "base/io/file.h"
#include "take/logs/event_log.h"
#include "take/logs/file_hashes.h"
#include "take/logs/log_files.h"
#include "wire/codec.h"
#include "wire/messages.h"

namespace v3d::take {

namespace {

/// Bytes per writeback request. Frequent requests write dirty pages evenly; otherwise the kernel
/// stalls writers when too many pages are dirty.
constexpr int64_t kWritebackBytes = 4 << 20;
/// Limit of bytes whose writeback has not finished: 1.5 s of an XGA camera. With a higher limit, a
/// disk that is too slow would be detected later, at the end of the take.
constexpr int64_t kMaxDirtyBytes = 32 << 20;

/// The bytes before an event's data (see event_log.cc).
wire::Bytes event_head(int64_t number, const std::string& channel, RealtimeInstant at,
                       size_t data_size) {
  wire::Bytes head;
  head.reserve(kEventHeaderSize + channel.size());
  put_big_endian(head, kEventSyncWord, 4);
  put_big_endian(head, static_cast<uint64_t>(number), 8);
  put_big_endian(head, static_cast<uint64_t>(to_ns(at) / 1000), 8);
  put_big_endian(head, channel.size(), 4);
  put_big_endian(head, data_size, 4);
  head.insert(head.end(), channel.begin(), channel.end());
  return head;
}

/// Where a writer appends to a log.
struct AppendPosition {
  std::filesystem::path segment;
  int64_t events = 0;  ///< number of events in earlier segments
};

/// Number of events in `segments`, from the indexes of recoveries; counts them when a segment has
/// no index that can be used.
io::Result<int64_t> count_events(const std::filesystem::path& log,
                                 const std::vector<std::filesystem::path>& segments) {
  int64_t events = 0;
  for (const auto& segment : segments) {
    std::error_code error;
    const auto index = load_segment_index(segment, std::filesystem::file_size(segment, error));
    if (!index || !*index) {
      const auto reader = EventLogReader::open(log);
      if (!reader) return tl::make_unexpected(reader.error());
      return static_cast<int64_t>(reader->events().size());
    }
    events += (*index)->events;
  }
  return events;
}

io::Result<AppendPosition> append_position(const std::filesystem::path& log, LogOpening opening,
                                           std::optional<int64_t> earlier_events) {
  if (opening == LogOpening::kNew) return AppendPosition{log, 0};
  const auto segments = existing_segments(log);
  if (!segments) return tl::make_unexpected(segments.error());
  if (!earlier_events) {
    const auto events = count_events(log, *segments);
    if (!events) return tl::make_unexpected(events.error());
    earlier_events = *events;
  }
  return AppendPosition{next_segment(log, *segments), *earlier_events};
}

}  // namespace

class EventLogWriter::Impl {
 public:
  Impl(const std::filesystem::path& log, LogOpening opening, LogHashing hashing,
       Duration sync_period, std::optional<int64_t> earlier_events)
      : Impl(io::value_or_throw(append_position(log, opening, earlier_events)), hashing,
             sync_period) {}
  /// Creates the segment; fails when the file exists.
  Impl(const AppendPosition& position, LogHashing hashing, Duration sync_period)
      : earlier_events_(position.events),
        events_(position.events),
        file_(io::value_or_throw(io::File::open(position.segment, io::OpenMode::kCreate))),
        sync_(file_, sync_period) {
    if (hashing == LogHashing::kTree) tree_.emplace();
  }
  ~Impl() {
    if (is_unsynced_) static_cast<void>(sync());
  }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  /// Appends an event with the data `first` and `rest`.
  ///
  /// Unbuffered: written bytes are in the kernel and survive the end of this process, and a full
  /// disk is reported for the event that does not fit. The next event overwrites the bytes of an
  /// event that failed.
  io::Status write(const std::string& channel, RealtimeInstant at, const wire::Bytes& first,
                   const wire::Bytes& rest = {}) {
    V3D_CHECK(channel.size() <= kMaxChannelSize);  // readers would not find the event
    keep_first_error(sync_.pop_error());
    if (!disk_error_) return disk_error_;
    const wire::Bytes head = event_head(events_, channel, at, first.size() + rest.size());
    const io::Status written = file_.write(static_cast<uint64_t>(bytes_), {head, first, rest});
    if (!written) return written;
    sync_.mark_dirty();
    is_unsynced_ = true;
    count({head, first, rest});
    ++events_;
    bytes_ += static_cast<int64_t>(head.size() + first.size() + rest.size());
    write_back();
    return written;
  }

  int64_t bytes() const { return bytes_; }
  const std::filesystem::path& path() const { return file_.path(); }
  TakeFile file() const {
    TakeFile file{.name = path().filename(),
                  .bytes = bytes_ + unfinished_bytes_,
                  .changed_ns = 0,
                  .checksum = checksum_.value()};
    if (tree_) file.root = tree_->root();
    return file;
  }

  io::Status sync() {
    is_unsynced_ = false;
    keep_first_error(sync_.sync());
    return disk_error_;
  }

  io::Status end() {
    io::Status ended = sync();
    return ended ? count_unfinished() : ended;
  }

  io::Status save_index() const {
    if (unfinished_bytes_ == 0) return {};
    return save_segment_index(path(), {.bytes = static_cast<uint64_t>(bytes_ + unfinished_bytes_),
                                       .whole_bytes = static_cast<uint64_t>(bytes_),
                                       .events = events_ - earlier_events_,
                                       .damaged_places = 0});
  }

 private:
  void keep_first_error(const io::Status& status) {
    if (disk_error_) disk_error_ = status;
  }

  /// Adds a written event to the checksum and to the hash tree.
  void count(std::initializer_list<std::span<const uint8_t>> parts) {
    for (const auto& part : parts) checksum_.add(part);
    if (!tree_) return;
    wire::LeafHash event;
    for (const auto& part : parts) event.add(part);
    tree_->add(event.value());
  }

  /// Adds the bytes of a failed write to the checksum and to the hash tree.
  io::Status count_unfinished() {
    const auto size = file_.size();
    if (!size) return tl::make_unexpected(size.error());
    const FileRange unfinished{.begin = static_cast<uint64_t>(bytes_), .end = *size};
    if (unfinished.begin >= unfinished.end) return {};
    const auto file = io::File::open(path(), io::OpenMode::kReadWithinFolder);
    if (!file) return tl::make_unexpected(file.error());
    io::Status added = add_to_checksum(*file, unfinished, checksum_);
    if (added && tree_) added = add_to_tree(*file, unfinished, *tree_);
    if (added) unfinished_bytes_ = static_cast<int64_t>(unfinished.end - unfinished.begin);
    return added;
  }

  /// Requests writeback of written bytes, and waits for those above kMaxDirtyBytes. Drops written
  /// pages from the page cache: a take is much larger than the memory, and a copy into fresh pages
  /// costs several times a copy into reused pages.
  void write_back() {
    if (bytes_ - submitted_ < kWritebackBytes) return;
    sync_range(submitted_, bytes_, SYNC_FILE_RANGE_WRITE);
    submitted_ = bytes_;
    const int64_t due = submitted_ - kMaxDirtyBytes;
    if (due > written_back_) {
      sync_range(written_back_, due, SYNC_FILE_RANGE_WAIT_BEFORE);
      written_back_ = due;
    }
    posix_fadvise(file_.fd(), 0, submitted_ - kWritebackBytes, POSIX_FADV_DONTNEED);
  }

  void sync_range(int64_t begin, int64_t end, unsigned flags) {
    if (sync_file_range(file_.fd(), begin, end - begin, flags) == 0) return;
    if (!is_unsupported_sync(errno)) keep_first_error(io::io_error("write", file_.path()));
  }

  const int64_t earlier_events_;  ///< number of events in earlier segments
  int64_t events_ = 0;            ///< number of the next event
  io::File file_;
  PeriodicSync sync_;
  bool is_unsynced_ = false;      ///< written to since the last sync()
  int64_t bytes_ = 0;             ///< end of the last whole event
  int64_t unfinished_bytes_ = 0;  ///< of a failed write, behind `bytes_`; after end()
  RunningChecksum checksum_;      ///< of these bytes
  std::optional<wire::HashTree> tree_;
  int64_t submitted_ = 0;     ///< bytes for which writeback was requested
  int64_t written_back_ = 0;  ///< bytes whose writeback has finished
  io::Status disk_error_;     ///< the first error after which written bytes may be lost
};

EventLogWriter::EventLogWriter(const std::filesystem::path& path, LogOpening opening,
                               LogHashing hashing, Duration sync_period,
                               std::optional<int64_t> earlier_events)
    : impl_(std::make_unique<Impl>(path, opening, hashing, sync_period, earlier_events)) {}
EventLogWriter::~EventLogWriter() = default;
EventLogWriter::EventLogWriter(EventLogWriter&&) noexcept = default;
EventLogWriter& EventLogWriter::operator=(EventLogWriter&&) noexcept = default;

io::Status EventLogWriter::write(const wire::FrameMessage& message) {
  return impl_->write(wire::frame_channel(message.frame.camera), message.sent, encode_head(message),
                      message.frame.image.bytes);
}
io::Status EventLogWriter::write(const wire::PulseMessage& message,
                                 std::optional<RealtimeInstant> edge_here) {
  return impl_->write(wire::kPulseChannel, edge_here.value_or(message.sent), encode(message));
}
int64_t EventLogWriter::bytes() const { return impl_->bytes(); }
const std::filesystem::path& EventLogWriter::path() const { return impl_->path(); }
TakeFile EventLogWriter::file() const { return impl_->file(); }
io::Status EventLogWriter::sync() { return impl_->sync(); }
io::Status EventLogWriter::end() { return impl_->end(); }
io::Status EventLogWriter::save_index() const { return impl_->save_index(); }

class FrameLogReader::Impl {
 public:
  Impl(const std::filesystem::path& path, const ReadProgress& progress, uint64_t from)
      : log_(path, progress, from), read_errors_(log_.read_errors()) {
    damaged_ = log_.damaged_places();
    for (const EventSpan& event : log_.events()) {
      const auto bytes = read(event, wire::kFrameHeadSize);
      if (progress) progress();
      const auto head = bytes ? wire::decode_frame_head(*bytes) : std::nullopt;
      if (!head || head->message_size != event.data_size) {
        ++damaged_;
        continue;
      }
      labels_.push_back(head->label);
      const Stored stored{&event, head->label.suspect};
      const auto [found, is_new] = stored_.emplace(head->label.pulse, stored);
      if (!is_new && found->second.suspect && !stored.suspect) found->second = stored;
    }
  }

  std::optional<Frame> read_deep(int64_t pulse) {
    const auto found = stored_.find(pulse);
    if (found == stored_.end()) return std::nullopt;
    const auto bytes = read(*found->second.event, SIZE_MAX);
    auto message = bytes ? wire::decode<wire::FrameMessage>(*bytes) : std::nullopt;
    if (!message) return std::nullopt;
    return std::move(message->frame);
  }

  const std::vector<FrameLabel>& labels() const { return labels_; }
  int64_t events() const { return std::ssize(log_.events()); }
  int64_t damaged() const { return damaged_; }
  int64_t torn_bytes() const { return log_.torn_bytes(); }
  const std::vector<std::string>& read_errors() const { return read_errors_; }

 private:
  /// Reads the first `limit` bytes of an event. Empty on a read error, which is added to
  /// read_errors_.
  std::optional<wire::Bytes> read(const EventSpan& event, size_t limit) {
    auto bytes = log_.read(event, limit);
    if (bytes) return *std::move(bytes);
    if (read_errors_.size() < kMaxReadErrors) read_errors_.push_back(bytes.error().message);
    return std::nullopt;
  }

  struct Stored {
    const EventSpan* event = nullptr;
    bool suspect = false;
  };
  static constexpr size_t kMaxReadErrors = 16;
  EventLogReader log_;
  std::vector<FrameLabel> labels_;
  std::unordered_map<int64_t, Stored> stored_;  ///< by pulse: the first frame that is not suspect
  std::vector<std::string> read_errors_;
  int64_t damaged_ = 0;
};

FrameLogReader::FrameLogReader(const std::filesystem::path& path, const ReadProgress& progress,
                               uint64_t from)
    : impl_(std::make_unique<Impl>(path, progress, from)) {}
FrameLogReader::~FrameLogReader() = default;
FrameLogReader::FrameLogReader(FrameLogReader&&) noexcept = default;
FrameLogReader& FrameLogReader::operator=(FrameLogReader&&) noexcept = default;

const std::vector<FrameLabel>& FrameLogReader::labels() const { return impl_->labels(); }
int64_t FrameLogReader::events() const { return impl_->events(); }
int64_t FrameLogReader::damaged_events() const { return impl_->damaged(); }
int64_t FrameLogReader::torn_bytes() const { return impl_->torn_bytes(); }
const std::vector<std::string>& FrameLogReader::read_errors() const { return impl_->read_errors(); }
std::optional<Frame> FrameLogReader::read(int64_t pulse) {
  std::optional<Frame> frame = read_deep(pulse);
  if (frame) reduce_to_8_bits(frame->image);
  return frame;
}
std::optional<Frame> FrameLogReader::read_deep(int64_t pulse) { return impl_->read_deep(pulse); }

namespace {

/// Empty when the event is no frame, or is damaged.
std::optional<Frame> frame_in(const io::File& segment, const EventSpan& event) {
  wire::Bytes bytes(std::min<size_t>(event.data_size, wire::kFrameHeadSize));
  if (!segment.read_whole(event.data_offset, bytes)) return std::nullopt;
  // A damaged length may be large, so the head is checked before the pixels are read.
  const auto head = wire::decode_frame_head(bytes);
  if (!head || head->message_size != event.data_size) return std::nullopt;
  bytes.resize(event.data_size);
  if (!segment.read_whole(event.data_offset, bytes)) return std::nullopt;
  auto message = wire::decode<wire::FrameMessage>(bytes);
  if (!message) return std::nullopt;
  return std::move(message->frame);
}

}  // namespace

std::optional<Frame> read_middle_frame(const std::filesystem::path& log) {
  std::optional<Frame> frame;
  io::value_or_throw(find_middle_event(log, [&](const io::File& segment, const EventSpan& event) {
    frame = frame_in(segment, event);
    return frame.has_value();
  }));
  if (frame) reduce_to_8_bits(frame->image);
  return frame;
}

std::vector<wire::PulseMessage> read_pulses(const std::filesystem::path& path,
                                            const ReadProgress& progress) {
  return read_pulses(EventLogReader(path, progress), progress);
}

std::vector<wire::PulseMessage> read_pulses(const EventLogReader& log,
                                            const ReadProgress& progress) {
  if (!log.read_errors().empty()) throw InputError(log.read_errors().front());
  std::vector<wire::PulseMessage> pulses;
  for (const EventSpan& event : log.events()) {
    if (event.data_size > kMaxPulseBytes) continue;
    const auto bytes = log.read(event);
    if (!bytes) throw InputError(bytes.error().message);
    if (progress) progress();
    if (auto pulse = wire::decode<wire::PulseMessage>(*bytes)) pulses.push_back(std::move(*pulse));
  }
  return pulses;
}

}  // namespace v3d::take
