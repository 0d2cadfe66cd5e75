#include "take/frame_log.h"

#include <fcntl.h>
#include <sys/uio.h>
#include <unistd.h>

#include <cerrno>
#include <span>
#include <unordered_map>

#include "base/error.h"
#include "take/event_log.h"
#include "wire/channels.h"
#include "wire/codec.h"

namespace v3d {

namespace {

/// So much is given to the disk at a time: dirty pages drain evenly instead of in one great stall
/// when the kernel finds that there are too many.
constexpr int64_t kDrainBytes = 4 << 20;
/// So much may wait for the disk: a second and a half of an XGA camera. More would only put off the
/// moment at which the disk is noticed to be too slow, to the end of the take.
constexpr int64_t kMostWaiting = 32 << 20;

void put_big_endian(Bytes& bytes, uint64_t value, int size) {
  for (int shift = 8 * (size - 1); shift >= 0; shift -= 8) {
    bytes.push_back(static_cast<uint8_t>(value >> shift));
  }
}

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

/// All of the parts, one behind the other; false when the disk refuses.
bool write_all(int fd, std::span<iovec> parts) {
  while (!parts.empty()) {
    ssize_t written = writev(fd, parts.data(), static_cast<int>(parts.size()));
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) return false;
    while (!parts.empty() && written >= static_cast<ssize_t>(parts.front().iov_len)) {
      written -= static_cast<ssize_t>(parts.front().iov_len);
      parts = parts.subspan(1);
    }
    if (written > 0) {
      parts.front().iov_base = static_cast<uint8_t*>(parts.front().iov_base) + written;
      parts.front().iov_len -= static_cast<size_t>(written);
    }
  }
  return true;
}

}  // namespace

class EventLogWriter::Impl {
 public:
  Impl(const std::filesystem::path& path, LogOpening opening)
      : fd_(open(path.c_str(),
                 O_WRONLY | O_CREAT | O_CLOEXEC | (opening == LogOpening::kNew ? O_TRUNC : 0),
                 0666)) {
    if (fd_ < 0) throw InputError(errno_message("cannot create log " + path.string()));
    if (opening == LogOpening::kGoOn) go_on(path);
  }
  ~Impl() {
    sync();
    ::close(fd_);
  }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  /// The data are `first` and `rest`. Not buffered: what was written is the kernel's, whatever
  /// becomes of us, and a full disk is noticed at the event that it hits.
  bool write(const std::string& channel, RealtimeInstant at, const Bytes& first,
             const Bytes& rest = {}) {
    if (broken_) return false;
    const Bytes head = event_head(events_, channel, at, first.size() + rest.size());
    iovec parts[] = {part_of(head), part_of(first), part_of(rest)};
    if (!write_all(fd_, parts)) {
      cut_back();
      return false;
    }
    ++events_;
    bytes_ += static_cast<int64_t>(head.size() + first.size() + rest.size());
    drain();
    return true;
  }

  int64_t bytes() const { return bytes_; }

  bool sync() {
    const bool refused = fsync(fd_) != 0 && is_of_the_disk(errno);
    broken_ = broken_ || refused;
    return !broken_;
  }

 private:
  void go_on(const std::filesystem::path& path) {
    events_ = static_cast<int64_t>(EventLogReader(path).events().size());
    bytes_ = given_ = taken_ = lseek(fd_, 0, SEEK_END);
  }

  /// writev() only reads.
  static iovec part_of(const Bytes& bytes) {
    return {const_cast<uint8_t*>(bytes.data()), bytes.size()};
  }

  /// What the disk has meanwhile taken leaves the page cache: a take is many times the memory, and
  /// pages used again are still warm, where fresh ones cost several times the copy.
  void drain() {
    if (bytes_ - given_ < kDrainBytes) return;
    sync_file_range(fd_, given_, bytes_ - given_, SYNC_FILE_RANGE_WRITE);
    given_ = bytes_;
    const int64_t due = given_ - kMostWaiting;
    if (due > taken_) {
      const int refused = sync_file_range(fd_, taken_, due - taken_, SYNC_FILE_RANGE_WAIT_BEFORE);
      broken_ = refused != 0 && is_of_the_disk(errno);
      taken_ = due;
    }
    posix_fadvise(fd_, 0, given_ - kDrainBytes, POSIX_FADV_DONTNEED);
  }

  /// Other errors say that this is no file that can be synchronised.
  static bool is_of_the_disk(int error) {
    return error == EIO || error == ENOSPC || error == EDQUOT || error == EROFS;
  }

  /// Removes what was written of an event that did not fit.
  void cut_back() const {
    if (ftruncate(fd_, bytes_) == 0) lseek(fd_, bytes_, SEEK_SET);
  }

  const int fd_;
  int64_t events_ = 0;
  int64_t bytes_ = 0;
  int64_t given_ = 0;    ///< bytes that the disk has been asked to take
  int64_t taken_ = 0;    ///< bytes that it has taken
  bool broken_ = false;  ///< it refused some of them
};

EventLogWriter::EventLogWriter(const std::filesystem::path& path, LogOpening opening)
    : impl_(std::make_unique<Impl>(path, opening)) {}
EventLogWriter::~EventLogWriter() = default;
EventLogWriter::EventLogWriter(EventLogWriter&&) noexcept = default;
EventLogWriter& EventLogWriter::operator=(EventLogWriter&&) noexcept = default;

bool EventLogWriter::write(const FrameMessage& message) {
  return impl_->write(frame_channel(message.frame.camera), message.sent, encode_head(message),
                      message.frame.image.bytes);
}
bool EventLogWriter::write(const PulseMessage& message) {
  return impl_->write(kPulseChannel, message.sent, encode(message));
}
int64_t EventLogWriter::bytes() const { return impl_->bytes(); }
bool EventLogWriter::close() { return impl_->sync(); }

class FrameLogReader::Impl {
 public:
  explicit Impl(const std::filesystem::path& path) : log_(path) {
    damaged_ = log_.damaged_places();
    for (const EventSpan& event : log_.events()) {
      const auto head = decode_frame_head(log_.read(event, kFrameHeadSize));
      if (!head || head->message_size != event.data_size) {
        ++damaged_;
        continue;
      }
      labels_.push_back(head->label);
      first_of_.emplace(head->label.pulse, &event);
    }
  }

  std::optional<Frame> read(int64_t pulse) const {
    const auto found = first_of_.find(pulse);
    if (found == first_of_.end()) return std::nullopt;
    auto message = decode<FrameMessage>(log_.read(*found->second));
    if (!message) return std::nullopt;
    return std::move(message->frame);
  }

  const std::vector<FrameLabel>& labels() const { return labels_; }
  int64_t damaged() const { return damaged_; }
  int64_t torn_bytes() const { return log_.torn_bytes(); }

 private:
  EventLogReader log_;
  std::vector<FrameLabel> labels_;
  std::unordered_map<int64_t, const EventSpan*> first_of_;
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
std::optional<Frame> FrameLogReader::read(int64_t pulse) { return impl_->read(pulse); }

std::vector<PulseMessage> read_pulses(const std::filesystem::path& path) {
  const EventLogReader log(path);
  std::vector<PulseMessage> pulses;
  for (const EventSpan& event : log.events()) {
    if (auto pulse = decode<PulseMessage>(log.read(event))) pulses.push_back(std::move(*pulse));
  }
  return pulses;
}

}  // namespace v3d
