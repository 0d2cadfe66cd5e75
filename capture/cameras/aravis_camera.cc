#include "capture/cameras/aravis_camera.h"

#include <arv.h>
#include <unistd.h>

#include <algorithm>
#include <condition_variable>
#include <mutex>
#include <stop_token>
#include <thread>
#include <utility>

#include "base/core/text.h"
#include "base/io/process.h"
#include "capture/cameras/aravis_device.h"
#include "capture/cameras/pixel_decoder.h"

namespace v3d::capture {

using aravis::Owned;
using aravis::Problem;
using aravis::Ptp;

namespace {

ImageSize image_size(const StudioCamera& settings, ArvCamera* camera) {
  Problem problem;
  ImageSize size;
  gint x = 0;
  gint y = 0;
  arv_camera_get_region(camera, &x, &y, &size.width, &size.height, problem);
  if (problem.happened()) aravis::fail(settings, "Width, Height", "an image", problem.text());
  return size;
}

/// The geometry of the images that the camera sends. Rows have no padding.
SentLayout sent_layout(const StudioCamera& settings, ArvCamera* camera) {
  const ImageSize size = image_size(settings, camera);
  const CameraFormat format = settings.pixel_format;
  const int step = width_step(format);
  if (size.width % step != 0) {
    aravis::fail(settings, "Width", "a multiple of " + std::to_string(step),
                 std::to_string(size.width));
  }
  return {format, size, row_bytes(format, size.width)};
}

size_t payload_bytes(const StudioCamera& settings, ArvCamera* camera, size_t image_bytes) {
  Problem problem;
  const size_t payload = arv_camera_get_payload(camera, problem);
  if (problem.happened() || payload < image_bytes) {
    aravis::fail(settings, "PayloadSize", "at least " + std::to_string(image_bytes) + " bytes",
                 problem.happened() ? problem.text() : std::to_string(payload));
  }
  return payload;
}

/// As far as the camera reports them.
CameraDevice read_device(ArvCamera* camera) {
  const auto read = [&](const char* feature) -> std::string {
    if (!aravis::has_feature(camera, feature)) return {};
    Problem problem;
    const char* text = arv_camera_get_string(camera, feature, problem);
    return problem.happened() || !text ? std::string() : printable(text);
  };
  std::string model = read("DeviceVendorName") + " " + read("DeviceModelName");
  std::string firmware = read("DeviceFirmwareVersion");
  if (firmware.empty()) firmware = read("DeviceVersion");
  return {std::move(model), std::move(firmware)};
}

/// Maximum time that Aravis waits for the missing packets of a frame. Later frames wait as well and
/// occupy buffers. A shorter time would drop frames whose packets a busy host has not yet read.
constexpr guint kFrameRetentionUs = 400'000;

/// Until its filter is in place, a packet socket receives all packets of its interface, also those
/// of other cameras. The kernel passes packets on in blocks, the last one after two timer intervals
/// of the 5 ms that Aravis sets. Nothing reports that, so this is a time, with a margin.
constexpr auto kLastBlockTime = std::chrono::milliseconds(30);
/// Maximum time until the thread that receives packets has discarded those of other cameras: longer
/// than a busy PC keeps a thread from running.
constexpr auto kDiscardTimeout = std::chrono::seconds(5);

/// Sets the receive buffer of a plain UDP socket to four frames, at most 64 MiB; a packet socket
/// ignores it. The kernel limits it to net.core.rmem_max.
void set_receiver(ArvStream* stream, size_t payload, bool resend) {
  if (!ARV_IS_GV_STREAM(stream)) return;
  const int room = static_cast<int>(std::min<size_t>(4 * payload, 64 << 20));
  g_object_set(stream, "socket-buffer", ARV_GV_STREAM_SOCKET_BUFFER_FIXED, "socket-buffer-size",
               room, "packet-resend",
               resend ? ARV_GV_STREAM_PACKET_RESEND_ALWAYS : ARV_GV_STREAM_PACKET_RESEND_NEVER,
               "frame-retention", kFrameRetentionUs, nullptr);
}

/// Aravis calls this function on its heartbeat thread.
void on_control_lost(ArvDevice*, gpointer lost) { *static_cast<std::atomic<bool>*>(lost) = true; }

/// The image in a complete buffer. Empty if the buffer is incomplete or has another size or format.
std::optional<Image> image_of(ArvBuffer* buffer, const SentLayout& layout) {
  if (arv_buffer_get_status(buffer) != ARV_BUFFER_STATUS_SUCCESS ||
      arv_buffer_get_image_width(buffer) != layout.size.width ||
      arv_buffer_get_image_height(buffer) != layout.size.height ||
      arv_buffer_get_image_pixel_format(buffer) != pfnc_code(layout.format)) {
    return {};
  }
  size_t bytes = 0;
  const void* data = arv_buffer_get_image_data(buffer, &bytes);
  if (!data) return {};
  return decode_image(layout, {static_cast<const uint8_t*>(data), bytes});
}

/// Reads clock offset and temperature of a camera at once, then every two seconds on a thread of
/// its own. Aravis waits up to three seconds for the answer to a lost packet; pictures do not wait.
class StateReader {
 public:
  /// `camera` must outlive this object, and nothing else may read its features meanwhile.
  StateReader(ArvCamera* camera, std::optional<Ptp> ptp)
      : camera_(camera),
        ptp_(ptp),
        has_temperature_(aravis::has_feature(camera, "DeviceTemperature")) {
    if (!ptp_ && !has_temperature_) return;
    read();
    thread_ = std::jthread([this](const std::stop_token& stop) { run(stop); });
  }

  /// Offset of the camera's clock from its PTP master. Empty while it is not synchronised, or if
  /// PTP is off.
  std::optional<Duration> ptp_offset() const {
    const std::lock_guard lock(mutex_);
    return ptp_offset_;
  }
  /// The clock is synchronised. A camera may give no offset although it is.
  bool ptp_locked() const {
    const std::lock_guard lock(mutex_);
    return ptp_locked_;
  }
  std::optional<double> temperature_celsius() const {
    const std::lock_guard lock(mutex_);
    return temperature_celsius_;
  }

 private:
  static constexpr Duration kPeriod = std::chrono::seconds(2);

  void run(const std::stop_token& stop) {
    std::unique_lock lock(mutex_);
    while (!wake_.wait_for(lock, stop, kPeriod, [&] { return stop.stop_requested(); })) {
      lock.unlock();
      read();
      lock.lock();
    }
  }

  void read() {
    const auto offset = ptp_ ? ptp_->offset() : std::nullopt;
    const bool locked = offset || (ptp_ && ptp_->is_synchronised());
    std::optional<double> celsius;
    if (has_temperature_) {
      Problem problem;
      celsius = arv_camera_get_float(camera_, "DeviceTemperature", problem);
      if (problem.happened()) celsius.reset();
    }
    const std::lock_guard lock(mutex_);
    ptp_offset_ = offset;
    ptp_locked_ = locked;
    temperature_celsius_ = celsius;
  }

  ArvCamera* camera_;
  const std::optional<Ptp> ptp_;
  const bool has_temperature_;
  mutable std::mutex mutex_;  ///< protects the next three members
  std::optional<Duration> ptp_offset_;
  bool ptp_locked_ = false;
  std::optional<double> temperature_celsius_;
  std::condition_variable_any wake_;
  std::jthread thread_;  ///< last member: it uses the others
};

}  // namespace

class AravisCamera::Link {
 public:
  Link(const StudioCamera& settings, std::atomic<bool>& lost)
      : camera_(aravis::open(settings)), lost_(lost) {
    ArvDevice* device = arv_camera_get_device(camera_.get());
    if (ARV_IS_GV_DEVICE(device) && !arv_gv_device_is_controller(ARV_GV_DEVICE(device))) {
      aravis::fail(settings, "control", "this program", "another program that controls it");
    }
    differences_ = aravis::write_settings(settings, camera_.get());
    device_ = read_device(camera_.get());
    layout_ = sent_layout(settings, camera_.get());
    if (settings.chunk_data) chunks_.reset(arv_camera_create_chunk_parser(camera_.get()));
    stream(settings, payload_bytes(settings, camera_.get(), layout_.byte_count()));
    const bool has_clock = settings.ptp || settings.action;
    state_.emplace(camera_.get(), has_clock ? Ptp::of(camera_.get()) : std::nullopt);
  }

  ~Link() {
    state_.reset();
    if (on_lost_) g_signal_handler_disconnect(arv_camera_get_device(camera_.get()), on_lost_);
    if (stream_ && !lost_) {
      Problem problem;  // ignored: a camera that no longer answers does not stream either
      arv_camera_stop_acquisition(camera_.get(), problem);
    }
  }

  const SentLayout& layout() const { return layout_; }
  ArvStream* stream() const { return stream_.get(); }
  const CameraDevice& device() const { return device_; }
  const std::vector<SettingDifference>& differences() const { return differences_; }

  /// Number of frames of this camera for which there was no buffer.
  int64_t underruns() const {
    guint64 all = 0;
    arv_stream_get_statistics(stream_.get(), nullptr, nullptr, &all);
    return static_cast<int64_t>(all) - foreign_underruns_;
  }

  const StateReader& state() const { return *state_; }

  /// Exposure time in microseconds from the chunk data of a frame; empty if it has none.
  std::optional<double> exposure_us(ArvBuffer* buffer) {
    if (!chunks_ || !arv_buffer_has_chunks(buffer)) return {};
    Problem problem;
    const double us =
        arv_chunk_parser_get_float_value(chunks_.get(), buffer, "ChunkExposureTime", problem);
    return problem.happened() ? std::nullopt : std::optional(us);
  }

 private:
  /// Called by the thread that receives the packets of this camera.
  static void on_stream(void* link, ArvStreamCallbackType type, ArvBuffer* /*buffer*/) {
    if (type != ARV_STREAM_CALLBACK_TYPE_INIT) return;
    static_cast<Link*>(link)->stream_thread_ = gettid();
    use_isolated_processors(IsolatedTask::kPackets);
  }

  /// Waits until the packets of other cameras are discarded. Requires that the stream has no
  /// buffers: it then keeps no frame. Its thread sleeps when it has read all packets.
  void discard_foreign_packets(const StudioCamera& settings) {
    const MonotonicInstant deadline = Monotonic::now() + kDiscardTimeout;
    do {
      if (Monotonic::now() > deadline) {
        aravis::fail(settings, "stream", "a receiver without packets of other cameras",
                     "one whose thread gets no processor time");
      }
      std::this_thread::sleep_for(kLastBlockTime);
    } while (!thread_sleeps(stream_thread_));
  }

  void stream(const StudioCamera& settings, size_t payload) {
    Problem problem;
    stream_.reset(arv_camera_create_stream(camera_.get(), on_stream, this, problem));
    if (!stream_ || problem.happened())
      aravis::fail(settings, "stream", "a receiver", problem.text());
    set_receiver(stream_.get(), payload, settings.packet_resend);
    if (settings.packet_socket) discard_foreign_packets(settings);
    foreign_underruns_ = underruns();
    for (int i = 0; i < settings.buffers; ++i) {
      arv_stream_push_buffer(stream_.get(), arv_buffer_new_allocate(payload));
    }
    on_lost_ = g_signal_connect(arv_camera_get_device(camera_.get()), "control-lost",
                                G_CALLBACK(on_control_lost), &lost_);
    Problem start;
    arv_camera_start_acquisition(camera_.get(), start);
    if (start.happened()) aravis::fail(settings, "AcquisitionStart", "a stream", start.text());
  }

  Owned<ArvCamera> camera_;
  Owned<ArvStream> stream_;  // destroyed before the camera, which feeds it
  Owned<ArvChunkParser> chunks_;
  std::atomic<pid_t> stream_thread_ = 0;  ///< receives the packets
  std::atomic<bool>& lost_;
  gulong on_lost_ = 0;
  int64_t foreign_underruns_ = 0;  ///< caused by frames of other cameras, before the first buffer
  SentLayout layout_;
  CameraDevice device_;
  std::vector<SettingDifference> differences_;
  std::optional<StateReader> state_;
};

AravisCamera::AravisCamera(StudioCamera settings) : settings_(std::move(settings)) {}
AravisCamera::~AravisCamera() = default;

void AravisCamera::start() {
  stop();
  lost_ = false;
  counter_ = {};
  link_ = std::make_unique<Link>(settings_, lost_);
  size_ = link_->layout().size;
}

void AravisCamera::stop() { link_.reset(); }

std::optional<CameraFrame> AravisCamera::wait(MonotonicInstant deadline) {
  while (link_) {
    ArvStream* stream = link_->stream();
    const auto left =
        std::chrono::duration_cast<std::chrono::microseconds>(deadline - Monotonic::now());
    ArvBuffer* buffer = arv_stream_timeout_pop_buffer(stream, std::max<int64_t>(left.count(), 0));
    read_statistics();
    store_ptp_offset(link_->state().ptp_offset());
    ptp_locked_ = link_->state().ptp_locked();
    temperature_celsius_ = link_->state().temperature_celsius().value_or(kNoTemperature);
    if (!buffer) return {};
    CameraFrame frame;
    frame.received = Monotonic::now();
    frame.device_time =
        from_ns<DeviceClock>(static_cast<int64_t>(arv_buffer_get_timestamp(buffer)));
    frame.counter = counter_.unwrap(arv_buffer_get_frame_id(buffer));
    auto image = image_of(buffer, link_->layout());
    if (const auto us = link_->exposure_us(buffer)) exposure_us_ = *us;
    arv_stream_push_buffer(stream, buffer);
    if (image) {
      ++completed_;
      frame.image = std::move(*image);
      return frame;
    }
    ++damaged_;
  }
  return {};
}

CameraDevice AravisCamera::device() const { return link_ ? link_->device() : CameraDevice(); }

/// GigE Vision numbers the blocks of a stream from 1, USB3 Vision from 0.
std::optional<uint64_t> AravisCamera::first_counter() const {
  if (!link_) return std::nullopt;
  return FrameCounter().unwrap(ARV_IS_GV_STREAM(link_->stream()) ? 1 : 0);
}

std::vector<SettingDifference> AravisCamera::differences() const {
  return link_ ? link_->differences() : std::vector<SettingDifference>();
}

void AravisCamera::store_ptp_offset(std::optional<Duration> offset) {
  has_ptp_offset_ = offset.has_value();
  if (offset) ptp_offset_ = *offset;
}

void AravisCamera::read_statistics() {
  ArvStream* stream = link_->stream();
  underruns_ = link_->underruns();
  if (!ARV_IS_GV_STREAM(stream)) return;
  guint64 resent = 0;
  guint64 missing = 0;
  arv_gv_stream_get_statistics(ARV_GV_STREAM(stream), &resent, &missing);
  packets_resent_ = static_cast<int64_t>(resent);
  packets_missing_ = static_cast<int64_t>(missing);
}

CameraStatistics AravisCamera::statistics() const {
  CameraStatistics statistics{.completed = completed_,
                              .damaged = damaged_,
                              .underruns = underruns_,
                              .packets_resent = packets_resent_,
                              .packets_missing = packets_missing_};
  statistics.ptp_locked = ptp_locked_;
  if (has_ptp_offset_) statistics.ptp_offset = ptp_offset_.load();
  if (exposure_us_ > 0) statistics.exposure_us = exposure_us_;
  if (temperature_celsius_ != kNoTemperature) statistics.temperature_celsius = temperature_celsius_;
  return statistics;
}

}  // namespace v3d::capture
