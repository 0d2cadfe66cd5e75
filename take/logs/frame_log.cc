#include "take/logs/frame_log.h"

#include <fcntl.h>

#include <cerrno>
#include <span>
#include <unordered_map>

#include "base/core/checksum.h"
#include "base/core/error.h"
#include "base/io/big_endian.h"
#include "base/io/file.h"
#include "take/logs/event_log.h"
#include "take/logs/log_segments.h"
#include "wire/channels.h"
#include "wire/codec.h"

namespace v3d {

namespace {

/// So much is given to the disk at a time: dirty pages drain evenly instead of in one great stall
/// when the kernel finds that there are too many.
constexpr int64_t kDrainBytes = 4 << 20;
/// So much may wait for the disk: a second and a half of an XGA camera. More would only put off the
/// moment at which the disk is noticed to be too slow, to the end of the take.
constexpr int64_t kMaxWaiting = 32 << 20;

/// What stands before an event's data (see event_log.cc).
Bytes event_head(int64_t number, const std::string& channel, RealtimeInstant at, size_t data_size) {
  Bytes head;
  head.reserve(kEventHeaderSize + channel.size());
  put_big_endian(head, kEventSyncWord, 4);
  put_big_endian(head, static_cast<uint64_t>(number), 8);
  put_big_endian(head, static_cast<uint64_t>(to_ns(at) / 1000), 8);
  put_big_endian(head, channel.size(), 4);
  put_big_endian(head, data_size, 4);
  head.insert(head.end(), channel.begin(), channel.end());
  return head;
}

/// Where recording into a log begins.
struct LogPlace {
  std::filesystem::path segment;
  int64_t events = 0;  ///< in the segments before
};

/// Events in the segments, as recoveries counted them, or else counted now.
io::Result<int64_t> count_events(const std::filesystem::path& log,
                                 const std::vector<std::filesystem::path>& segments) {
  int64_t events = 0;
  for (const auto& segment : segments) {
    std::error_code error;
    const auto index = load_segment_index(segment, std::filesystem::file_size(segment, error));
    if (!index) {
      const auto reader = EventLogReader::open(log);
      if (!reader) return tl::make_unexpected(reader.error());
      return static_cast<int64_t>(reader->events().size());
    }
    events += index->events;
  }
  return events;
}

io::Result<LogPlace> place_of(const std::filesystem::path& log, LogOpening opening) {
  if (opening == LogOpening::kNew) return LogPlace{log, 0};
  const auto segments = existing_segments(log);
  if (!segments) return tl::make_unexpected(segments.error());
  const auto events = count_events(log, *segments);
  if (!events) return tl::make_unexpected(events.error());
  return LogPlace{next_segment(log, *segments), *events};
}

}  // namespace

class EventLogWriter::Impl {
 public:
  Impl(const std::filesystem::path& log, LogOpening opening, LogHashing hashing)
      : Impl(io::value_or_throw(place_of(log, opening)), hashing) {}
  /// Never a file that exists.
  Impl(const LogPlace& place, LogHashing hashing)
      : events_(place.events),
        file_(io::value_or_throw(io::File::open(place.segment, io::OpenMode::kCreate))) {
    if (hashing == LogHashing::kTree) tree_.emplace();
  }
  ~Impl() { static_cast<void>(sync()); }  // close() reports
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  /// The data are `first` and `rest`. Not buffered: what was written is the kernel's, whatever
  /// becomes of this process, and a full disk is noticed at the event that it hits. The bytes of an
  /// event that failed are overwritten by the next one; write() reported that event as failed.
  io::Status write(const std::string& channel, RealtimeInstant at, const Bytes& first,
                   const Bytes& rest = {}) {
    if (!lost_) return lost_;
    const Bytes head = event_head(events_, channel, at, first.size() + rest.size());
    const io::Status written = file_.write(static_cast<uint64_t>(bytes_), {head, first, rest});
    if (!written) return written;
    count({head, first, rest});
    ++events_;
    bytes_ += static_cast<int64_t>(head.size() + first.size() + rest.size());
    drain();
    return written;
  }

  int64_t bytes() const { return bytes_; }
  const std::filesystem::path& path() const { return file_.path(); }
  TakeFile file() const {
    TakeFile file{
        .name = path().filename(), .bytes = bytes_, .changed_ns = 0, .checksum = checksum_.value()};
    if (tree_) file.root = tree_->root();
    return file;
  }

  io::Status sync() {
    const io::Status synced = file_.sync();
    if (lost_ && !synced && is_of_the_disk(synced.error().code)) lost_ = synced;
    return lost_;
  }

 private:
  /// The event that was written.
  void count(std::initializer_list<std::span<const uint8_t>> parts) {
    for (const auto& part : parts) checksum_.add(part);
    if (!tree_) return;
    LeafHash event;
    for (const auto& part : parts) event.add(part);
    tree_->add(event.value());
  }

  /// What the disk has meanwhile taken leaves the page cache: a take is many times the memory, and
  /// pages used again are still warm, where fresh ones cost several times the copy.
  void drain() {
    if (bytes_ - given_ < kDrainBytes) return;
    sync_file_range(file_.fd(), given_, bytes_ - given_, SYNC_FILE_RANGE_WRITE);
    given_ = bytes_;
    const int64_t due = given_ - kMaxWaiting;
    if (due > taken_) {
      const int failed =
          sync_file_range(file_.fd(), taken_, due - taken_, SYNC_FILE_RANGE_WAIT_BEFORE);
      if (failed != 0 && is_of_the_disk(errno)) lost_ = io::io_error("write", file_.path());
      taken_ = due;
    }
    posix_fadvise(file_.fd(), 0, given_ - kDrainBytes, POSIX_FADV_DONTNEED);
  }

  /// Other errors say that this is no file that can be synchronised.
  static bool is_of_the_disk(int error) {
    return error == EIO || error == ENOSPC || error == EDQUOT || error == EROFS;
  }

  int64_t events_ = 0;
  io::File file_;
  int64_t bytes_ = 0;
  RunningChecksum checksum_;  ///< of these bytes
  std::optional<HashTree> tree_;
  int64_t given_ = 0;  ///< bytes that the disk has been asked to take
  int64_t taken_ = 0;  ///< bytes that it has taken
  io::Status lost_;    ///< an error when the disk lost some of them
};

EventLogWriter::EventLogWriter(const std::filesystem::path& path, LogOpening opening,
                               LogHashing hashing)
    : impl_(std::make_unique<Impl>(path, opening, hashing)) {}
EventLogWriter::~EventLogWriter() = default;
EventLogWriter::EventLogWriter(EventLogWriter&&) noexcept = default;
EventLogWriter& EventLogWriter::operator=(EventLogWriter&&) noexcept = default;

io::Status EventLogWriter::write(const FrameMessage& message) {
  return impl_->write(frame_channel(message.frame.camera), message.sent, encode_head(message),
                      message.frame.image.bytes);
}
io::Status EventLogWriter::write(const PulseMessage& message) {
  return impl_->write(kPulseChannel, message.sent, encode(message));
}
int64_t EventLogWriter::bytes() const { return impl_->bytes(); }
const std::filesystem::path& EventLogWriter::path() const { return impl_->path(); }
TakeFile EventLogWriter::file() const { return impl_->file(); }
io::Status EventLogWriter::sync() { return impl_->sync(); }

class FrameLogReader::Impl {
 public:
  explicit Impl(const std::filesystem::path& path) : log_(path), read_errors_(log_.read_errors()) {
    damaged_ = log_.damaged_places();
    for (const EventSpan& event : log_.events()) {
      const auto bytes = read(event, kFrameHeadSize);
      const auto head = bytes ? decode_frame_head(*bytes) : std::nullopt;
      if (!head || head->message_size != event.data_size) {
        ++damaged_;
        continue;
      }
      labels_.push_back(head->label);
      first_of_.emplace(head->label.pulse, &event);
    }
  }

  std::optional<Frame> read(int64_t pulse) {
    const auto found = first_of_.find(pulse);
    if (found == first_of_.end()) return std::nullopt;
    const auto bytes = read(*found->second, SIZE_MAX);
    auto message = bytes ? decode<FrameMessage>(*bytes) : std::nullopt;
    if (!message) return std::nullopt;
    return std::move(message->frame);
  }

  const std::vector<FrameLabel>& labels() const { return labels_; }
  int64_t damaged() const { return damaged_; }
  int64_t torn_bytes() const { return log_.torn_bytes(); }
  const std::vector<std::string>& read_errors() const { return read_errors_; }

 private:
  /// Empty, and reported, where the disk does not give the bytes.
  std::optional<Bytes> read(const EventSpan& event, size_t limit) {
    auto bytes = log_.read(event, limit);
    if (bytes) return *std::move(bytes);
    if (read_errors_.size() < kMaxReadErrors) read_errors_.push_back(bytes.error().message);
    return std::nullopt;
  }

  static constexpr size_t kMaxReadErrors = 16;
  EventLogReader log_;
  std::vector<FrameLabel> labels_;
  std::unordered_map<int64_t, const EventSpan*> first_of_;
  std::vector<std::string> read_errors_;
  int64_t damaged_ = 0;
};

FrameLogReader::FrameLogReader(const std::filesystem::path& path)
    : impl_(std::make_unique<Impl>(path)) {}
FrameLogReader::~FrameLogReader() = default;
FrameLogReader::FrameLogReader(FrameLogReader&&) noexcept = default;
FrameLogReader& FrameLogReader::operator=(FrameLogReader&&) noexcept = default;

const std::vector<FrameLabel>& FrameLogReader::labels() const { return impl_->labels(); }
int64_t FrameLogReader::damaged_events() const { return impl_->damaged(); }
int64_t FrameLogReader::torn_bytes() const { return impl_->torn_bytes(); }
const std::vector<std::string>& FrameLogReader::read_errors() const { return impl_->read_errors(); }
std::optional<Frame> FrameLogReader::read(int64_t pulse) { return impl_->read(pulse); }

std::vector<PulseMessage> read_pulses(const std::filesystem::path& path) {
  const EventLogReader log(path);
  if (!log.read_errors().empty()) throw InputError(log.read_errors().front());
  std::vector<PulseMessage> pulses;
  for (const EventSpan& event : log.events()) {
    if (event.data_size > kMaxPulseBytes) continue;
    const auto bytes = log.read(event);
    if (!bytes) throw InputError(bytes.error().message);
    if (auto pulse = decode<PulseMessage>(*bytes)) pulses.push_back(std::move(*pulse));
  }
  return pulses;
}

}  // namespace v3d
