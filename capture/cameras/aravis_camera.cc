#include "capture/cameras/aravis_camera.h"

#include <arv.h>

#include <algorithm>
#include <thread>
#include <utility>

#include "capture/cameras/aravis_find.h"
#include "capture/cameras/aravis_object.h"
#include "capture/cameras/aravis_ptp.h"
#include "capture/cameras/aravis_setup.h"

namespace v3d {

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
  if (problem.happened()) aravis::refuse(settings, "Width, Height", "an image", problem.text());
  return size;
}

size_t payload_bytes(const StudioCamera& settings, ArvCamera* camera, size_t image_bytes) {
  Problem problem;
  const size_t payload = arv_camera_get_payload(camera, problem);
  if (problem.happened() || payload < image_bytes) {
    aravis::refuse(settings, "PayloadSize", std::to_string(image_bytes) + " bytes at least",
                   problem.happened() ? problem.text() : std::to_string(payload));
  }
  return payload;
}

/// A frame waits so long for its missing packets. Frames behind it wait too, so it costs buffers;
/// a shorter time gives up frames whose packets a busy host has only not looked at yet.
constexpr guint kFrameRetentionUs = 400'000;

/// A packet socket hears all that passes on its interface until its filter is in place. Whatever it
/// heard of other cameras by then, Aravis has thrown away after this time, if it had no buffer to
/// make a frame of it.
constexpr auto kStrangersGone = std::chrono::milliseconds(30);

/// Room for four frames of a camera in the socket, where packets do not come by packet socket; the
/// kernel gives what net.core.rmem_max allows.
void set_receiver(ArvStream* stream, size_t payload, bool resend) {
  if (!ARV_IS_GV_STREAM(stream)) return;
  const int room = static_cast<int>(std::min<size_t>(4 * payload, 64 << 20));
  g_object_set(stream, "socket-buffer", ARV_GV_STREAM_SOCKET_BUFFER_FIXED, "socket-buffer-size",
               room, "packet-resend",
               resend ? ARV_GV_STREAM_PACKET_RESEND_ALWAYS : ARV_GV_STREAM_PACKET_RESEND_NEVER,
               "frame-retention", kFrameRetentionUs, nullptr);
}

/// Called by Aravis' heartbeat thread.
void on_control_lost(ArvDevice*, gpointer lost) { *static_cast<std::atomic<bool>*>(lost) = true; }

/// The pixels of a buffer that arrived whole and is what was asked for.
std::optional<Image> image_of(ArvBuffer* buffer, ImageSize size, PixelFormat format) {
  if (arv_buffer_get_status(buffer) != ARV_BUFFER_STATUS_SUCCESS ||
      arv_buffer_get_image_width(buffer) != size.width ||
      arv_buffer_get_image_height(buffer) != size.height ||
      arv_buffer_get_image_pixel_format(buffer) != static_cast<ArvPixelFormat>(format)) {
    return {};
  }
  size_t bytes = 0;
  const void* data = arv_buffer_get_image_data(buffer, &bytes);
  if (!data || bytes < byte_count(size, format)) return {};
  const auto* first = static_cast<const uint8_t*>(data);
  Image image;
  image.size = size;
  image.format = format;
  image.bytes.assign(first, first + byte_count(size, format));
  return image;
}

}  // namespace

class AravisCamera::Link {
 public:
  Link(const StudioCamera& settings, std::atomic<bool>& lost)
      : camera_(aravis::open(settings)), lost_(lost) {
    ArvDevice* device = arv_camera_get_device(camera_.get());
    if (ARV_IS_GV_DEVICE(device) && !arv_gv_device_is_controller(ARV_GV_DEVICE(device))) {
      aravis::refuse(settings, "control", "this program", "another program that has it");
    }
    aravis::write_settings(settings, camera_.get());
    size_ = image_size(settings, camera_.get());
    const size_t image_bytes = byte_count(size_, settings.pixel_format);
    if (settings.ptp) ptp_ = Ptp::of(camera_.get());
    if (settings.chunk_data) chunks_.reset(arv_camera_create_chunk_parser(camera_.get()));
    stream(settings, payload_bytes(settings, camera_.get(), image_bytes));
  }

  ~Link() {
    if (on_lost_) g_signal_handler_disconnect(arv_camera_get_device(camera_.get()), on_lost_);
    if (stream_ && !lost_) {
      Problem problem;  // a camera that does not answer any more has stopped, too
      arv_camera_stop_acquisition(camera_.get(), problem);
    }
  }

  ImageSize size() const { return size_; }
  ArvStream* stream() const { return stream_.get(); }

  /// Frames for which there was no buffer.
  int64_t underruns() const {
    guint64 all = 0;
    arv_stream_get_statistics(stream_.get(), nullptr, nullptr, &all);
    return static_cast<int64_t>(all) - strangers_;
  }

  /// Of the camera's clock from its PTP master; empty while it is not in step, or where PTP is not
  /// asked for. Asks the camera, twice in a while.
  std::optional<Duration> ptp_offset() {
    if (!ptp_ || Monotonic::now() < next_ptp_look_) return ptp_offset_;
    next_ptp_look_ = Monotonic::now() + kPtpEvery;
    ptp_offset_ = ptp_->offset();
    return ptp_offset_;
  }

  /// By the chunk data of a frame; empty where it has none.
  std::optional<double> exposure_us(ArvBuffer* buffer) {
    if (!chunks_ || !arv_buffer_has_chunks(buffer)) return {};
    Problem problem;
    const double us =
        arv_chunk_parser_get_float_value(chunks_.get(), buffer, "ChunkExposureTime", problem);
    return problem.happened() ? std::nullopt : std::optional(us);
  }

 private:
  static constexpr Duration kPtpEvery = std::chrono::seconds(2);

  void stream(const StudioCamera& settings, size_t payload) {
    Problem problem;
    stream_.reset(arv_camera_create_stream(camera_.get(), nullptr, nullptr, problem));
    if (!stream_ || problem.happened())
      aravis::refuse(settings, "stream", "a receiver", problem.text());
    set_receiver(stream_.get(), payload, settings.packet_resend);
    if (settings.packet_socket) std::this_thread::sleep_for(kStrangersGone);
    strangers_ = underruns();
    for (int i = 0; i < settings.buffers; ++i) {
      arv_stream_push_buffer(stream_.get(), arv_buffer_new_allocate(payload));
    }
    on_lost_ = g_signal_connect(arv_camera_get_device(camera_.get()), "control-lost",
                                G_CALLBACK(on_control_lost), &lost_);
    Problem start;
    arv_camera_start_acquisition(camera_.get(), start);
    if (start.happened()) aravis::refuse(settings, "AcquisitionStart", "a stream", start.text());
  }

  Owned<ArvCamera> camera_;
  Owned<ArvStream> stream_;  // goes before the camera that feeds it
  Owned<ArvChunkParser> chunks_;
  std::atomic<bool>& lost_;
  gulong on_lost_ = 0;
  int64_t strangers_ = 0;  ///< frames of other cameras, for which there was no buffer
  ImageSize size_;
  std::optional<Ptp> ptp_;
  MonotonicInstant next_ptp_look_{};
  std::optional<Duration> ptp_offset_;
};

AravisCamera::AravisCamera(StudioCamera settings) : settings_(std::move(settings)) {}
AravisCamera::~AravisCamera() = default;

void AravisCamera::start() {
  stop();
  lost_ = false;
  counter_ = {};
  link_ = std::make_unique<Link>(settings_, lost_);
  size_ = link_->size();
}

void AravisCamera::stop() { link_.reset(); }

std::optional<CameraFrame> AravisCamera::wait(MonotonicInstant deadline) {
  while (link_) {
    ArvStream* stream = link_->stream();
    const auto left =
        std::chrono::duration_cast<std::chrono::microseconds>(deadline - Monotonic::now());
    ArvBuffer* buffer = arv_stream_timeout_pop_buffer(stream, std::max<int64_t>(left.count(), 0));
    read_statistics();
    tell_ptp(link_->ptp_offset());
    if (!buffer) return {};
    CameraFrame frame;
    frame.received = Monotonic::now();
    frame.device_time =
        from_ns<DeviceClock>(static_cast<int64_t>(arv_buffer_get_timestamp(buffer)));
    frame.counter = counter_.unwrap(arv_buffer_get_frame_id(buffer));
    auto image = image_of(buffer, size_, settings_.pixel_format);
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

void AravisCamera::tell_ptp(std::optional<Duration> offset) {
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
  if (has_ptp_offset_) statistics.ptp_offset = ptp_offset_.load();
  if (exposure_us_ > 0) statistics.exposure_us = exposure_us_;
  return statistics;
}

}  // namespace v3d
