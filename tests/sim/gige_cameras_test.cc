// Tests the simulated cameras with a real GigE Vision client.
#include "sim/cameras/gige_cameras.h"

#include <arpa/inet.h>
#include <arv.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/socket.h>

#include <ctime>
#include <memory>
#include <mutex>
#include <optional>

#include "base/core/error.h"
#include "support/child_process.h"
#include "support/message_of.h"

namespace v3d::sim {
namespace {

constexpr int kCameras = 3;
constexpr ImageSize kSize{256, 192};
constexpr int kBuffers = 40;
/// The receive buffer holds their images while the receiver does not run.
constexpr int kEdgesAtOnce = 3;
constexpr int kReceiveBytes = 200'000;  ///< a kernel grants it without settings
constexpr uint64_t kDeadlineUs = 20'000'000;

struct Unref {
  void operator()(void* object) const { g_object_unref(object); }
};
template <class T>
using Owned = std::unique_ptr<T, Unref>;

/// A client that opens a camera like the capture daemon: triggered on Line1, large packets.
class Receiver {
 public:
  explicit Receiver(int index, const char* source = "Line1") {
    camera_.reset(arv_camera_new(gige_address(index).c_str(), nullptr));
    if (camera_ == nullptr) return;
    arv_camera_set_string(camera_.get(), "TriggerSelector", "FrameStart", nullptr);
    arv_camera_set_string(camera_.get(), "TriggerSource", source, nullptr);
    arv_camera_set_string(camera_.get(), "TriggerActivation", "RisingEdge", nullptr);
    arv_camera_set_string(camera_.get(), "TriggerMode", "On", nullptr);
    arv_camera_gv_set_packet_size(camera_.get(), 30000, nullptr);
    // The ring of a packet socket has 16 blocks, and the kernel closes one every 5 ms. A receiver
    // that does not run for 80 ms loses packets, however small they are.
    arv_camera_gv_set_stream_options(camera_.get(), ARV_GV_STREAM_OPTION_PACKET_SOCKET_DISABLED);
    stream_.reset(arv_camera_create_stream(camera_.get(), nullptr, nullptr, nullptr));
    // A busy host may stop the camera's thread within an image, and this receiver for longer.
    g_object_set(stream_.get(), "frame-retention", 10'000'000U, "socket-buffer",
                 ARV_GV_STREAM_SOCKET_BUFFER_FIXED, "socket-buffer-size", kReceiveBytes, nullptr);
    for (int i = 0; i < kBuffers; ++i) {
      arv_stream_push_buffer(
          stream_.get(), arv_buffer_new_allocate(arv_camera_get_payload(camera_.get(), nullptr)));
    }
    arv_camera_start_acquisition(camera_.get(), nullptr);
  }
  ~Receiver() {
    if (camera_ != nullptr) arv_camera_stop_acquisition(camera_.get(), nullptr);
  }
  ArvCamera* camera() const { return camera_.get(); }
  Owned<ArvBuffer> next(uint64_t timeout_us = kDeadlineUs) const {
    return Owned<ArvBuffer>(arv_stream_timeout_pop_buffer(stream_.get(), timeout_us));
  }

 private:
  Owned<ArvCamera> camera_;
  Owned<ArvStream> stream_;
};

/// Cameras with a different image for each camera and edge.
class Studio {
 public:
  explicit Studio(std::vector<Fault> faults_of_first = {}) {
    std::vector<GigeCamera> cameras;
    const MonotonicInstant origin = Monotonic::now();
    for (int i = 0; i < kCameras; ++i) {
      cameras.push_back({gige_address(i), gige_serial(i), kSize, PixelFormat::kBayerRG8,
                         simulated_clock(i, 1, origin),
                         i == 0 ? std::move(faults_of_first) : std::vector<Fault>()});
    }
    for (int i = 0; i < kCameras * kEdges; ++i) {
      pictures_.emplace_back(static_cast<size_t>(kSize.pixels()), static_cast<uint8_t>(20 + i));
    }
    cameras_ = std::make_unique<GigeCameras>(
        std::move(cameras),
        [this](int camera, int64_t edge) {
          return std::span<const uint8_t>(picture(camera, edge));
        },
        [this](const Exposure& exposure) {
          const std::lock_guard lock(mutex_);
          exposures_.push_back(exposure);
        },
        1);
  }
  static constexpr int kEdges = 30;
  const std::vector<uint8_t>& picture(int camera, int64_t edge) const {
    return pictures_[static_cast<size_t>(camera * kEdges + edge)];
  }
  GigeCameras& cameras() { return *cameras_; }
  std::vector<Exposure> exposures() const {
    const std::lock_guard lock(mutex_);
    return exposures_;
  }

 private:
  std::vector<std::vector<uint8_t>> pictures_;
  mutable std::mutex mutex_;
  std::vector<Exposure> exposures_;
  std::unique_ptr<GigeCameras> cameras_;  ///< last member: its threads use the others
};

TEST(GigeCameras, have_the_features_of_triggered_colour_cameras) {
  const Studio studio;
  const Receiver receiver(1);
  ASSERT_NE(receiver.camera(), nullptr);
  const auto text = [&](const char* feature) {
    const char* value = arv_camera_get_string(receiver.camera(), feature, nullptr);
    return std::string(value != nullptr ? value : "");
  };
  EXPECT_EQ(text("DeviceSerialNumber"), "V3D-SIM-02");
  EXPECT_EQ(text("TriggerSource"), "Line1");
  EXPECT_EQ(text("PixelFormat"), "BayerRG8");
  EXPECT_EQ(arv_camera_get_payload(receiver.camera(), nullptr), static_cast<guint>(kSize.pixels()));
  arv_camera_set_exposure_time(receiver.camera(), 1000, nullptr);
  EXPECT_EQ(arv_camera_get_exposure_time(receiver.camera(), nullptr), 1000);
  arv_camera_set_gain(receiver.camera(), 2.5, nullptr);
  EXPECT_EQ(arv_camera_get_gain(receiver.camera(), nullptr), 2.5);
}

TEST(GigeCameras, stream_one_image_per_edge_with_the_time_of_the_edge) {
  Studio studio;
  std::vector<std::unique_ptr<Receiver>> receivers;
  for (int i = 0; i < kCameras; ++i) {
    receivers.push_back(std::make_unique<Receiver>(i));
    ASSERT_NE(receivers.back()->camera(), nullptr);
  }
  std::vector<std::vector<int64_t>> times(kCameras);
  std::vector<uint64_t> last_ids(kCameras, 0);
  for (int64_t first = 0; first < Studio::kEdges; first += kEdgesAtOnce) {
    // A busy camera queues the later ones.
    for (int64_t edge = first; edge < first + kEdgesAtOnce; ++edge) {
      studio.cameras().trigger(edge, Monotonic::now());
    }
    for (int i = 0; i < kCameras; ++i) {
      const auto c = static_cast<size_t>(i);
      for (int64_t edge = first; edge < first + kEdgesAtOnce; ++edge) {
        const Owned<ArvBuffer> buffer = receivers[c]->next();
        ASSERT_NE(buffer, nullptr) << "camera " << i << " edge " << edge;
        ASSERT_EQ(arv_buffer_get_status(buffer.get()), ARV_BUFFER_STATUS_SUCCESS);
        size_t size = 0;
        const auto* data =
            static_cast<const uint8_t*>(arv_buffer_get_image_data(buffer.get(), &size));
        EXPECT_EQ(std::vector<uint8_t>(data, data + size), studio.picture(i, edge));
        const uint64_t id = arv_buffer_get_frame_id(buffer.get());
        if (edge > 0) {
          EXPECT_EQ(id, last_ids[c] == 65535 ? 1 : last_ids[c] + 1);
        }
        last_ids[c] = id;
        times[c].push_back(static_cast<int64_t>(arv_buffer_get_timestamp(buffer.get())));
      }
    }
  }
  const std::vector<Exposure> record = studio.exposures();
  EXPECT_EQ(record.size(), static_cast<size_t>(kCameras * Studio::kEdges));
  for (const Exposure& exposure : record) {
    EXPECT_EQ(times[static_cast<size_t>(exposure.camera)][static_cast<size_t>(exposure.edge)],
              to_ns(exposure.device_time));
  }
}

TEST(GigeCameras, ignore_edges_without_an_acquisition) {
  Studio studio;
  studio.cameras().trigger(0, Monotonic::now());
  EXPECT_EQ(studio.cameras().ignored(), kCameras);
  const Receiver receiver(0);
  studio.cameras().trigger(1, Monotonic::now());
  const Owned<ArvBuffer> buffer = receiver.next();
  ASSERT_NE(buffer, nullptr);
  const std::vector<Exposure> record = studio.exposures();
  ASSERT_EQ(record.size(), 1U);
  EXPECT_EQ(record[0].edge, 1);
  EXPECT_EQ(studio.cameras().ignored(), 2 * kCameras - 1);
}

Fault fault(int64_t edge, FaultKind kind) {
  Fault fault;
  fault.pulse = edge;
  fault.kind = kind;
  return fault;
}

TEST(GigeCameras, inject_faults_of_single_images) {
  Studio studio({fault(1, FaultKind::kDrop), fault(3, FaultKind::kMissed),
                 fault(5, FaultKind::kDuplicate), fault(7, FaultKind::kBlack)});
  const Receiver receiver(0);
  ASSERT_NE(receiver.camera(), nullptr);
  std::vector<uint64_t> numbers;
  std::vector<int> first_pixels;
  int64_t edge = 0;
  for (const int images : {2, 3, 3}) {
    for (int i = 0; i < kEdgesAtOnce; ++i) studio.cameras().trigger(edge++, Monotonic::now());
    for (int i = 0; i < images; ++i) {
      const Owned<ArvBuffer> buffer = receiver.next();
      ASSERT_NE(buffer, nullptr);
      size_t size = 0;
      const auto* data =
          static_cast<const uint8_t*>(arv_buffer_get_image_data(buffer.get(), &size));
      numbers.push_back(arv_buffer_get_frame_id(buffer.get()));
      first_pixels.push_back(data[0]);
    }
  }
  EXPECT_EQ(receiver.next(0), nullptr);
  for (uint64_t& number : numbers) number -= 65'000;
  EXPECT_THAT(first_pixels, testing::ElementsAre(20, 22, 24, 25, 25, 26, 0, 28));
  EXPECT_THAT(numbers, testing::ElementsAre(0, 2, 3, 4, 5, 6, 7, 8));
  const std::vector<Exposure> record = studio.exposures();
  ASSERT_EQ(record.size(), 8U) << "one for each image that is sent";
  EXPECT_EQ(record[3].device_time, record[4].device_time);
  EXPECT_TRUE(record[6].black);
}

TEST(GigeCameras, disconnect_while_unplugged_and_restart_their_counters) {
  Fault unplug = fault(1, FaultKind::kUnplug);
  unplug.time = std::chrono::milliseconds(100);
  unplug.new_clock = true;
  Studio studio({unplug});
  std::optional<Receiver> receiver(0);
  ASSERT_NE(receiver->camera(), nullptr);
  studio.cameras().trigger(0, Monotonic::now());
  ASSERT_NE(receiver->next(), nullptr);
  studio.cameras().trigger(1, Monotonic::now());
  receiver.reset();
  ASSERT_TRUE(
      test::becomes_true([&] { return studio.cameras().is_plugged_in(0); }, test::within(60)));
  receiver.emplace(0);
  ASSERT_NE(receiver->camera(), nullptr);
  studio.cameras().trigger(2, Monotonic::now());
  const Owned<ArvBuffer> buffer = receiver->next();
  ASSERT_NE(buffer, nullptr);
  EXPECT_EQ(arv_buffer_get_frame_id(buffer.get()), 1U);
  EXPECT_LT(arv_buffer_get_timestamp(buffer.get()), 60'000'000'000U) << "a clock from 0";
  EXPECT_EQ(studio.exposures().back().edge, 2);
  EXPECT_EQ(studio.exposures().size(), 2U);
}

/// Sends action commands to the broadcast address of the loopback network.
class Commander {
 public:
  Commander() : socket_(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0)) {
    const int on = 1;
    setsockopt(socket_.get(), SOL_SOCKET, SO_BROADCAST, &on, sizeof on);
  }
  void send(const io::ActionCommand& command) const {
    sockaddr_in to{};
    to.sin_family = AF_INET;
    to.sin_port = htons(io::kGvcpPort);
    inet_pton(AF_INET, "127.255.255.255", &to.sin_addr);
    const std::vector<uint8_t> bytes = encode(command);
    ASSERT_GT(sendto(socket_.get(), bytes.data(), bytes.size(), 0,
                     reinterpret_cast<const sockaddr*>(&to), sizeof to),
              0);
  }
  /// "127.0.0.11: success", or "" when no acknowledgement comes in time.
  std::string acknowledgement(int timeout_ms = 20'000) const {
    pollfd readable{socket_.get(), POLLIN, 0};
    if (poll(&readable, 1, timeout_ms) <= 0) return "";
    std::vector<uint8_t> bytes(64);
    sockaddr_in from{};
    socklen_t length = sizeof from;
    const ssize_t size = recvfrom(socket_.get(), bytes.data(), bytes.size(), 0,
                                  reinterpret_cast<sockaddr*>(&from), &length);
    const auto decoded =
        io::decode_action_acknowledgement(std::span(bytes).first(static_cast<size_t>(size)));
    return std::string(inet_ntoa(from.sin_addr)) + ": " +
           (decoded ? text_of(decoded->status) : "unreadable");
  }

 private:
  io::UniqueFd socket_;
};

void set_keys(ArvCamera* camera, int device_key, bool ptp) {
  arv_camera_set_integer(camera, "ActionDeviceKey", device_key, nullptr);
  arv_camera_set_integer(camera, "ActionGroupKey", 2, nullptr);
  arv_camera_set_integer(camera, "ActionGroupMask", 3, nullptr);
  arv_camera_set_boolean(camera, "PtpEnable", ptp, nullptr);
}

int64_t tai_now() {
  timespec now{};
  clock_gettime(CLOCK_TAI, &now);
  return int64_t{now.tv_sec} * 1'000'000'000 + now.tv_nsec;
}

TEST(GigeCameras, expose_at_the_time_of_an_action_command_with_their_keys) {
  Studio studio;
  const Receiver first(0, "Action1");
  const Receiver wrong_key(1, "Action1");
  const Receiver on_cable(2);
  set_keys(first.camera(), 1, true);
  set_keys(wrong_key.camera(), 7, true);
  const Commander commander;
  io::ActionCommand command{.device_key = 1, .group_key = 2, .group_mask = 2};
  int pulse = 0;
  for (int in_time = 0; in_time < 2; ++pulse) {
    ASSERT_LT(pulse, Studio::kEdges);
    command.request = static_cast<uint16_t>(pulse + 1);
    command.time_ns = tai_now() + 2'000'000'000;
    commander.send(command);
    const std::string answer = commander.acknowledgement();
    // A busy host may read the command two seconds late.
    if (answer != "127.0.0.11: command too late") {
      ASSERT_EQ(answer, "127.0.0.11: success");
      ++in_time;
    }
    ASSERT_NE(first.next(), nullptr);
    EXPECT_GE(tai_now(), *command.time_ns);
    const std::vector<Exposure> record = studio.exposures();
    ASSERT_EQ(record.size(), static_cast<size_t>(pulse + 1)) << "other cameras do not expose";
    EXPECT_EQ(record.back().camera, 0);
    EXPECT_EQ(record.back().edge, pulse);
  }
  EXPECT_EQ(studio.cameras().actions(), pulse);
}

TEST(GigeCameras, reject_the_time_of_an_action_without_ptp_and_report_a_late_one) {
  Studio studio;
  const Receiver unlocked(0, "Action1");
  set_keys(unlocked.camera(), 1, false);
  const Commander commander;
  io::ActionCommand command{.device_key = 1, .group_key = 2, .group_mask = 1, .time_ns = 1};
  commander.send(command);
  EXPECT_EQ(commander.acknowledgement(), "127.0.0.11: no PTP time");
  command.time_ns.reset();
  commander.send(command);
  EXPECT_EQ(commander.acknowledgement(), "127.0.0.11: success");
  ASSERT_NE(unlocked.next(), nullptr);
  set_keys(unlocked.camera(), 1, true);
  command.time_ns = 1;
  commander.send(command);
  EXPECT_EQ(commander.acknowledgement(), "127.0.0.11: command too late");
  ASSERT_NE(unlocked.next(), nullptr);
  EXPECT_EQ(studio.exposures().size(), 2U);
}

TEST(GigeCameras, neither_acknowledge_nor_obey_an_action_that_they_miss) {
  Studio studio({fault(0, FaultKind::kMissed)});
  const Receiver receiver(0, "Action1");
  set_keys(receiver.camera(), 1, false);
  const Commander commander;
  io::ActionCommand command{.device_key = 1, .group_key = 2, .group_mask = 1};
  commander.send(command);
  command.request = 2;
  commander.send(command);
  EXPECT_EQ(commander.acknowledgement(), "127.0.0.11: success");
  ASSERT_NE(receiver.next(), nullptr);
  EXPECT_EQ(commander.acknowledgement(0), "");
  ASSERT_EQ(studio.exposures().size(), 1U);
  EXPECT_EQ(studio.exposures()[0].edge, 1);
}

TEST(GigeCameras, name_the_missing_address) {
  const GigeCamera nowhere{"127.0.9.9", "V3D-SIM-99", kSize, PixelFormat::kBayerRG8, {}, {}};
  const std::string refusal = test::message_of<InputError>(
      [&] { const GigeCameras cameras({nowhere}, nullptr, nullptr, 1); });
  EXPECT_THAT(refusal, testing::HasSubstr("127.0.9.9"));
}

}  // namespace
}  // namespace v3d::sim
