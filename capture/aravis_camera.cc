#include "capture/aravis_camera.h"

#include <arv.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <mutex>
#include <string>
#include <thread>
#include <utility>

#include "base/error.h"

namespace v3d {
namespace {

struct Unref {
  void operator()(gpointer object) const { g_object_unref(object); }
};
template <class T>
using Owned = std::unique_ptr<T, Unref>;

/// Where one call of Aravis puts its error; frees it.
class Problem {
 public:
  Problem() = default;
  ~Problem() { g_clear_error(&error_); }
  Problem(const Problem&) = delete;
  Problem& operator=(const Problem&) = delete;
  operator GError**() { return &error_; }  // NOLINT(google-explicit-constructor)
  bool happened() const { return error_ != nullptr; }
  std::string text() const { return error_ ? error_->message : "no reason given"; }

 private:
  GError* error_ = nullptr;
};

// ---- Finding the camera

/// The list of devices is global in Aravis and is addressed by index.
std::mutex& device_list_mutex() {
  static std::mutex mutex;
  return mutex;
}

std::string device_with_serial(const std::string& serial) {
  for (unsigned i = 0; i < arv_get_n_devices(); ++i) {
    const char* found = arv_get_device_serial_nbr(i);
    if (found && serial == found) return arv_get_device_id(i);
  }
  return {};
}

std::string serials_found() {
  std::string list;
  for (unsigned i = 0; i < arv_get_n_devices(); ++i) {
    const char* serial = arv_get_device_serial_nbr(i);
    list += (list.empty() ? "" : ", ") + std::string(serial ? serial : "?");
  }
  return list.empty() ? "no camera at all" : list;
}

Owned<ArvCamera> open_by_address(const StudioCamera& settings) {
  Problem problem;
  Owned<ArvCamera> camera(arv_camera_new(settings.address.c_str(), problem));
  if (!camera || problem.happened()) {
    throw InputError("camera " + settings.name + ": nothing answers at " + settings.address + " (" +
                     problem.text() + ")");
  }
  return camera;
}

/// Asks the network only when the list of the last time does not lead to the camera: a search takes
/// a second, and a node opens many cameras.
Owned<ArvCamera> open_by_serial(const StudioCamera& settings) {
  const std::lock_guard lock(device_list_mutex());
  std::string cause;
  for (const bool search : {false, true}) {
    if (search) arv_update_device_list();
    const std::string id = device_with_serial(settings.address);
    if (id.empty()) continue;
    Problem problem;
    Owned<ArvCamera> camera(arv_camera_new(id.c_str(), problem));
    if (camera && !problem.happened()) return camera;
    cause = problem.text();
  }
  throw InputError(
      "camera " + settings.name + ": " +
      (cause.empty()
           ? "no camera has the serial number '" + settings.address + "'; found: " + serials_found()
           : "serial number " + settings.address + " was found, but " + cause));
}

Owned<ArvCamera> open(const StudioCamera& settings) {
  const bool is_ip = g_hostname_is_ip_address(settings.address.c_str());
  return is_ip ? open_by_address(settings) : open_by_serial(settings);
}

// ---- Setting it up

/// What the features of PTP are called: by the SFNC since version 2.2, and by cameras before.
struct PtpNames {
  const char* enable;
  const char* status;
  const char* latch;
  const char* offset;
};
constexpr std::array<PtpNames, 2> kPtpNames = {
    {{"PtpEnable", "PtpStatus", "PtpDataSetLatch", "PtpOffsetFromMaster"},
     {"GevIEEE1588", "GevIEEE1588Status", "GevIEEE1588DataSetLatch",
      "GevIEEE1588OffsetFromMaster"}}};

/// A camera has so long to agree with the others on a master and to follow it.
constexpr Duration kPtpWithin = std::chrono::seconds(20);
constexpr Duration kPtpLook = std::chrono::milliseconds(100);

bool has_feature(ArvCamera* camera, const char* feature) {
  Problem problem;
  return arv_camera_is_feature_available(camera, feature, problem) && !problem.happened();
}

/// Null where the camera has none.
const PtpNames* ptp_names(ArvCamera* camera) {
  const auto found = std::find_if(kPtpNames.begin(), kPtpNames.end(), [&](const PtpNames& names) {
    return has_feature(camera, names.enable);
  });
  return found == kPtpNames.end() ? nullptr : &*found;
}

/// "Slave", "Master", "Listening", ...
std::string ptp_status(ArvCamera* camera, const PtpNames& names) {
  Problem problem;
  const char* status = arv_camera_get_string(camera, names.status, problem);
  return problem.happened() || !status ? "no answer" : status;
}

/// The master of the studio is in step with itself.
bool is_in_step(const std::string& ptp_status) {
  return ptp_status == "Slave" || ptp_status == "Master";
}

/// Writes settings and reads them back.
class Setup {
 public:
  Setup(const StudioCamera& settings, ArvCamera* camera) : settings_(settings), camera_(camera) {}

  void all() {
    stop_what_runs();
    choose("AcquisitionMode", "Continuous");
    choose("PixelFormat", std::string(name(settings_.pixel_format)));
    choose_if_there("ExposureAuto", "Off");
    choose_if_there("GainAuto", "Off");
    exposure();
    gain();
    trigger();
    if (arv_camera_is_gv_device(camera_)) gigabit();
    if (settings_.chunk_data) chunk_data();
    if (settings_.ptp) follow_ptp();
  }

  [[noreturn]] void refuse(const std::string& feature, const std::string& wanted,
                           const std::string& got) const {
    throw InputError("camera " + settings_.name + ": " + feature + ": wanted " + wanted + ", got " +
                     got);
  }

 private:
  bool there(const char* feature) const { return has_feature(camera_, feature); }

  /// A program that died left the camera acquiring: it would go on sending to that program, and
  /// its format is locked.
  void stop_what_runs() {
    Problem problem;
    arv_camera_stop_acquisition(camera_, problem);
    if (problem.happened()) refuse("AcquisitionStop", "a camera at rest", problem.text());
  }

  void choose(const char* feature, const std::string& wanted) {
    Problem set;
    arv_camera_set_string(camera_, feature, wanted.c_str(), set);
    if (set.happened()) refuse(feature, wanted, set.text());
    Problem get;
    const char* got = arv_camera_get_string(camera_, feature, get);
    if (get.happened() || !got) refuse(feature, wanted, get.text());
    if (wanted != got) refuse(feature, wanted, got);
  }

  void choose_if_there(const char* feature, const std::string& wanted) {
    if (there(feature)) choose(feature, wanted);
  }

  /// Cameras round to their own steps: `tolerance` is what we let them.
  template <class Set, class Get>
  void number(const char* feature, double wanted, double tolerance, Set set, Get get) {
    Problem setting;
    set(setting);
    if (setting.happened()) refuse(feature, std::to_string(wanted), setting.text());
    Problem getting;
    const double got = get(getting);
    if (getting.happened()) refuse(feature, std::to_string(wanted), getting.text());
    if (!(std::abs(got - wanted) <= tolerance)) {
      refuse(feature, std::to_string(wanted), std::to_string(got));
    }
  }

  void exposure() {
    const double wanted = settings_.exposure_us;
    number(
        "ExposureTime (us)", wanted, 1 + 0.01 * wanted,
        [&](GError** e) { arv_camera_set_exposure_time(camera_, wanted, e); },
        [&](GError** e) { return arv_camera_get_exposure_time(camera_, e); });
  }

  void gain() {
    Problem problem;
    if (!arv_camera_is_gain_available(camera_, problem) && settings_.gain_db == 0) return;
    number(
        "Gain (dB)", settings_.gain_db, 0.1,
        [&](GError** e) { arv_camera_set_gain(camera_, settings_.gain_db, e); },
        [&](GError** e) { return arv_camera_get_gain(camera_, e); });
  }

  /// The mode comes last: a camera that is switched on first would expose at the edges of whatever
  /// line it listened to before.
  void trigger() {
    Problem clear;
    arv_camera_clear_triggers(camera_, clear);
    if (clear.happened()) refuse("TriggerMode", "Off", clear.text());
    choose_if_there("TriggerSelector", "FrameStart");
    choose("TriggerSource", settings_.trigger_line);
    if (settings_.trigger_edge == Edge::kFalling) {
      choose("TriggerActivation", "FallingEdge");
    } else {
      choose_if_there("TriggerActivation", "RisingEdge");
    }
    choose("TriggerMode", "On");
  }

  void gigabit() {
    if (settings_.packet_size == 0) {
      Problem problem;
      arv_camera_gv_auto_packet_size(camera_, problem);
      if (problem.happened()) refuse("packet size", "the largest that passes", problem.text());
    } else {
      number(
          "GevSCPSPacketSize", settings_.packet_size, 0,
          [&](GError** e) { arv_camera_gv_set_packet_size(camera_, settings_.packet_size, e); },
          [&](GError** e) { return arv_camera_gv_get_packet_size(camera_, e); });
    }
    arv_camera_gv_set_packet_size_adjustment(camera_, ARV_GV_PACKET_SIZE_ADJUSTMENT_NEVER);
    packet_delay();
    arv_camera_gv_set_stream_options(camera_, settings_.packet_socket
                                                  ? ARV_GV_STREAM_OPTION_NONE
                                                  : ARV_GV_STREAM_OPTION_PACKET_SOCKET_DISABLED);
  }

  /// Given in ticks of the camera's clock, so it may come back a tick short. A camera without the
  /// register has no delay.
  void packet_delay() {
    if (!there("GevSCPD") && settings_.packet_delay_ns == 0) return;
    number(
        "GevSCPD (ns)", settings_.packet_delay_ns, 100,
        [&](GError** e) { arv_camera_gv_set_packet_delay(camera_, settings_.packet_delay_ns, e); },
        [&](GError** e) {
          return static_cast<double>(arv_camera_gv_get_packet_delay(camera_, e));
        });
  }

  void switch_on(const char* feature) {
    Problem set;
    arv_camera_set_boolean(camera_, feature, true, set);
    if (set.happened()) refuse(feature, "true", set.text());
    Problem get;
    const bool on = arv_camera_get_boolean(camera_, feature, get);
    if (get.happened() || !on) refuse(feature, "true", get.happened() ? get.text() : "false");
  }

  /// Streams only when its clock is in step: a clock that is set right in the middle of a take
  /// makes its frames suspect.
  void follow_ptp() {
    const PtpNames* names = ptp_names(camera_);
    if (!names) refuse("ptp", "PtpEnable", "a camera without it");
    switch_on(names->enable);
    const MonotonicInstant deadline = Monotonic::now() + kPtpWithin;
    std::string status = ptp_status(camera_, *names);
    while (!is_in_step(status) && Monotonic::now() < deadline) {
      std::this_thread::sleep_for(kPtpLook);
      status = ptp_status(camera_, *names);
    }
    if (!is_in_step(status)) refuse(names->status, "Slave or Master", status);
  }

  /// Of what is of use to us, what the camera has.
  void chunk_data() {
    if (!there("ChunkModeActive")) refuse("chunk_data", "ChunkModeActive", "a camera without it");
    switch_on("ChunkModeActive");
    for (const char* chunk : {"Timestamp", "ExposureTime"}) {
      Problem set;
      arv_camera_set_string(camera_, "ChunkSelector", chunk, set);
      if (!set.happened()) switch_on("ChunkEnable");
    }
  }

  const StudioCamera& settings_;
  ArvCamera* camera_;
};

ImageSize image_size(const Setup& setup, ArvCamera* camera) {
  Problem problem;
  ImageSize size;
  gint x = 0;
  gint y = 0;
  arv_camera_get_region(camera, &x, &y, &size.width, &size.height, problem);
  if (problem.happened()) setup.refuse("Width, Height", "an image", problem.text());
  return size;
}

size_t payload_bytes(const Setup& setup, ArvCamera* camera, size_t image_bytes) {
  Problem problem;
  const size_t payload = arv_camera_get_payload(camera, problem);
  if (problem.happened() || payload < image_bytes) {
    setup.refuse("PayloadSize", std::to_string(image_bytes) + " bytes at least",
                 problem.happened() ? problem.text() : std::to_string(payload));
  }
  return payload;
}

/// A frame waits so long for its missing packets. Frames behind it wait too, so it costs buffers;
/// a shorter time gives up frames whose packets a busy host has only not looked at yet.
constexpr guint kFrameRetentionUs = 400'000;

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
      : camera_(open(settings)), lost_(lost) {
    Setup setup(settings, camera_.get());
    ArvDevice* device = arv_camera_get_device(camera_.get());
    if (ARV_IS_GV_DEVICE(device) && !arv_gv_device_is_controller(ARV_GV_DEVICE(device))) {
      setup.refuse("control", "this program", "another program that has it");
    }
    setup.all();
    size_ = image_size(setup, camera_.get());
    const size_t image_bytes = byte_count(size_, settings.pixel_format);
    if (settings.ptp) ptp_ = ptp_names(camera_.get());
    if (settings.chunk_data) chunks_.reset(arv_camera_create_chunk_parser(camera_.get()));
    stream(setup, payload_bytes(setup, camera_.get(), image_bytes), settings);
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

  /// Of the camera's clock from its PTP master; empty while it is not in step, or where PTP is not
  /// asked for. Asks the camera, twice in a while.
  std::optional<Duration> ptp_offset() {
    if (!ptp_ || Monotonic::now() < next_ptp_look_) return ptp_offset_;
    next_ptp_look_ = Monotonic::now() + kPtpEvery;
    Problem latched;
    arv_camera_execute_command(camera_.get(), ptp_->latch, latched);
    Problem asked;
    const gint64 offset = arv_camera_get_integer(camera_.get(), ptp_->offset, asked);
    const bool in_step = is_in_step(ptp_status(camera_.get(), *ptp_));
    ptp_offset_ = in_step && !asked.happened() ? std::optional(Duration(offset)) : std::nullopt;
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

  void stream(const Setup& setup, size_t payload, const StudioCamera& settings) {
    Problem problem;
    stream_.reset(arv_camera_create_stream(camera_.get(), nullptr, nullptr, problem));
    if (!stream_ || problem.happened()) setup.refuse("stream", "a receiver", problem.text());
    set_receiver(stream_.get(), payload, settings.packet_resend);
    for (int i = 0; i < settings.buffers; ++i) {
      arv_stream_push_buffer(stream_.get(), arv_buffer_new_allocate(payload));
    }
    on_lost_ = g_signal_connect(arv_camera_get_device(camera_.get()), "control-lost",
                                G_CALLBACK(on_control_lost), &lost_);
    Problem start;
    arv_camera_start_acquisition(camera_.get(), start);
    if (start.happened()) setup.refuse("AcquisitionStart", "a stream", start.text());
  }

  Owned<ArvCamera> camera_;
  Owned<ArvStream> stream_;  // goes before the camera that feeds it
  Owned<ArvChunkParser> chunks_;
  std::atomic<bool>& lost_;
  gulong on_lost_ = 0;
  ImageSize size_;
  const PtpNames* ptp_ = nullptr;
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
    // What reaches a packet socket before its filter is in place (other cameras' packets) begins
    // frames that never were any.
    if (arv_buffer_get_status(buffer) == ARV_BUFFER_STATUS_CLEARED) {
      arv_stream_push_buffer(stream, buffer);
      continue;
    }
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
  guint64 underruns = 0;
  arv_stream_get_statistics(stream, nullptr, nullptr, &underruns);
  underruns_ = static_cast<int64_t>(underruns);
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
