#include "take/frame_log.h"

#include <lcm/lcm.h>
#include <stdio_ext.h>
#include <unistd.h>

#include <cerrno>
#include <unordered_map>

#include "base/error.h"
#include "take/event_log.h"
#include "wire/channels.h"
#include "wire/codec.h"

namespace v3d {

class EventLogWriter::Impl {
 public:
  explicit Impl(const std::filesystem::path& path) : log_(lcm_eventlog_create(path.c_str(), "w")) {
    if (log_ == nullptr) throw InputError(errno_message("cannot create log " + path.string()));
  }
  ~Impl() {
    flush();
    fsync(fileno(log_->f));
    lcm_eventlog_destroy(log_);
  }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  bool write(std::string channel, RealtimeInstant at, Bytes data) {
    lcm_eventlog_event_t event{};
    event.timestamp = to_ns(at) / 1000;
    event.channel = channel.data();
    event.channellen = static_cast<int32_t>(channel.size());
    event.data = data.data();
    event.datalen = static_cast<int32_t>(data.size());
    // Flushed event by event: what was written is then the kernel's, whatever becomes of us, and a
    // full disk is noticed at the event that it hits.
    if (lcm_eventlog_write_event(log_, &event) != 0 || !flush()) {
      cut_back();
      return false;
    }
    bytes_ = ftello(log_->f);
    return true;
  }

  bool flush() { return fflush(log_->f) == 0; }
  int64_t bytes() const { return bytes_; }

 private:
  /// Removes what was written of an event that did not fit.
  void cut_back() {
    __fpurge(log_->f);  // else stdio would send them again before the next event
    clearerr(log_->f);
    if (ftruncate(fileno(log_->f), bytes_) == 0) fseeko(log_->f, bytes_, SEEK_SET);
  }

  lcm_eventlog_t* log_;
  int64_t bytes_ = 0;
};

EventLogWriter::EventLogWriter(const std::filesystem::path& path)
    : impl_(std::make_unique<Impl>(path)) {}
EventLogWriter::~EventLogWriter() = default;
EventLogWriter::EventLogWriter(EventLogWriter&&) noexcept = default;
EventLogWriter& EventLogWriter::operator=(EventLogWriter&&) noexcept = default;

bool EventLogWriter::write(const FrameMessage& message) {
  return impl_->write(frame_channel(message.frame.camera), message.sent, encode(message));
}
bool EventLogWriter::write(const PulseMessage& message) {
  return impl_->write(kPulseChannel, message.sent, encode(message));
}
bool EventLogWriter::flush() { return impl_->flush(); }
int64_t EventLogWriter::bytes() const { return impl_->bytes(); }

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
