// AravisCamera with images that a test sends: packed layouts, chunk data, and packets of other
// cameras.
#include <arv.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <fstream>
#include <string>
#include <thread>
#include <vector>

#include "base/image/camera_format.h"
#include "capture/cameras/aravis_camera.h"
#include "capture/fake_camera.h"
#include "sim/cameras/gige_cameras.h"
#include "support/gvsp_sender.h"
#include "support/temporary_folder.h"

namespace v3d::capture {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using testing::HasSubstr;

MonotonicInstant in(Duration d) { return Monotonic::now() + d; }

TEST(AravisCamera, receives_12_bits_in_the_packed_layouts_of_gige_vision) {
  for (const char* format_name : {"BayerRG12Packed", "BayerRG12p", "BayerRG10Packed"}) {
    const SimulatedCamera sim;
    sim.fake.write(ARV_FAKE_CAMERA_REGISTER_SENSOR_HEIGHT, 64);
    sim.fake.write(ARV_FAKE_CAMERA_REGISTER_HEIGHT, 64);
    StudioCamera wanted = SimulatedCamera::settings();
    wanted.packet_socket = false;
    const CameraFormat format = camera_format_from_name(format_name).value();
    wanted.pixel_format = format;
    AravisCamera camera(wanted);
    camera.start();
    EXPECT_EQ(camera.format(), format.image);
    const ImageSize size = camera.size();
    std::vector<uint8_t> samples(static_cast<size_t>(size.pixels()));
    for (size_t i = 0; i < samples.size(); ++i) samples[i] = static_cast<uint8_t>(i * 7);
    test::GvspSender sender(static_cast<uint16_t>(sim.fake.read(0x0d00)));
    sender.send_image(1, size, sim::packed_samples(samples, format), 8000 - 36,
                      pfnc_code(format).value(), false);
    auto frame = camera.wait(in(seconds(10)));
    ASSERT_TRUE(frame) << format_name;
    const int low_bits = bits_per_sample(format.image) - 8;
    for (const size_t i : {size_t{0}, size_t{1}, size_t{77}, samples.size() - 1}) {
      const int sample = frame->image.bytes[2 * i] | frame->image.bytes[2 * i + 1] << 8;
      EXPECT_EQ(sample, samples[i] << low_bits | static_cast<int>(i % (1U << low_bits)))
          << format_name << " " << i;
    }
    reduce_to_8_bits(frame->image);
    EXPECT_EQ(frame->image.bytes, samples) << format_name;
  }
}

constexpr uint32_t kChunkModeActive = 0x320;
constexpr uint32_t kChunkEnable = 0x324;
constexpr uint32_t kExposureChunk = 0x1003;

/// GenICam description of the simulated camera with the chunk `chunk`.
std::string genicam_with_chunk(const std::string& chunk) {
  std::string xml = sim::genicam_xml();
  const std::string last = "</RegisterDescription>";
  const auto boolean = [](const std::string& name, const std::string& address) {
    return "<Boolean Name='" + name + "'><pValue>" + name +
           "Register</pValue><OnValue>1</OnValue>" +
           "<OffValue>0</OffValue></Boolean><IntReg Name='" + name + "Register'><Address>" +
           address +
           "</Address><Length>4</Length><AccessMode>RW</AccessMode><pPort>Device</pPort>" +
           "<Sign>Unsigned</Sign><Endianess>BigEndian</Endianess></IntReg>";
  };
  xml.replace(
      xml.find(last), last.size(),
      boolean("ChunkModeActive", "0x320") + boolean("ChunkEnable", "0x324") +
          "<Enumeration Name='ChunkSelector'><EnumEntry Name='" + chunk +
          "'><Value>0</Value></EnumEntry><pValue>ChunkSelectorValue</pValue></Enumeration>" +
          "<Integer Name='ChunkSelectorValue'><Value>0</Value></Integer>" +
          "<Port Name='ExposureChunk'><ChunkID>1003</ChunkID></Port>" +
          "<FloatReg Name='ChunkExposureTime'><Address>0</Address><Length>8</Length>" +
          "<AccessMode>RO</AccessMode><pPort>ExposureChunk</pPort>" +
          "<Endianess>BigEndian</Endianess></FloatReg>" + last);
  const std::string image_bytes = "&amp; 0xFF) / 8";
  xml.replace(xml.find(image_bytes), image_bytes.size(), image_bytes + " + 24");
  return xml;
}

TEST(AravisCamera, reports_the_exposure_time_in_the_chunk_data) {
  const test::TemporaryFolder folder;
  const std::string description = folder / "genicam.xml";
  std::ofstream(description) << genicam_with_chunk("ExposureTime");
  const FakeCamera fake(description.c_str());
  fake.write(ARV_FAKE_CAMERA_REGISTER_HEIGHT, 128);  // a frame that fits the default socket buffer
  StudioCamera wanted = settings();
  wanted.trigger_line = "Line1";
  wanted.packet_socket = false;
  wanted.chunk_data = true;
  AravisCamera camera(wanted);
  camera.start();
  EXPECT_EQ(fake.read(kChunkModeActive), 1U);
  EXPECT_EQ(fake.read(kChunkEnable), 1U);
  EXPECT_FALSE(camera.statistics().exposure_us) << "before the first image";
  const auto [width, height] = camera.size();
  const std::vector<uint8_t> pixels(static_cast<size_t>(width) * height, 77);
  test::NetworkBytes payload;
  payload.raw(pixels).u32(1).u32(static_cast<uint32_t>(pixels.size()));
  payload.f64(2498.5).u32(kExposureChunk).u32(8);
  test::GvspSender sender(static_cast<uint16_t>(fake.read(0x0d00)));
  sender.send_image(1, camera.size(), payload.bytes(), 8000 - 36);
  const auto frame = camera.wait(in(seconds(10)));
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->image.bytes, pixels) << "the image does not contain the chunks";
  EXPECT_EQ(camera.statistics().exposure_us, 2498.5);
}

/// Another camera. Until the end of the test it sends small images to a closed port.
class Neighbour {
 public:
  explicit Neighbour(ImageSize size)
      : thread_([this, size](const std::stop_token& stop) {
          const std::vector<uint8_t> pixels(static_cast<size_t>(size.width) * size.height, 99);
          test::NetworkBytes payload;
          payload.raw(pixels).u32(1).u32(static_cast<uint32_t>(pixels.size()));
          for (uint16_t frame = 1; !stop.stop_requested(); frame = frame % 60'000 + 1) {
            sender_.send_image(frame, size, payload.bytes(), 8000 - 36);
            ++sent_;
          }
        }) {}
  int64_t sent() const { return sent_; }

 private:
  test::GvspSender sender_{9};  // discard
  std::atomic<int64_t> sent_ = 0;
  std::jthread thread_;
};

TEST(AravisCamera, ignores_packets_of_other_cameras_while_it_opens) {
  const FakeCamera fake;
  fake.write(ARV_FAKE_CAMERA_REGISTER_WIDTH, 64);
  fake.write(ARV_FAKE_CAMERA_REGISTER_HEIGHT, 64);
  const Neighbour neighbour({64, 64});
  AravisCamera camera(settings());
  for (int i = 0; i < 15; ++i) {
    camera.start();
    EXPECT_FALSE(camera.wait(in(milliseconds(50)))) << "opened for the " << i + 1 << ". time";
    EXPECT_EQ(camera.statistics().damaged, 0);
    EXPECT_EQ(camera.statistics().underruns, 0);
  }
  EXPECT_GT(neighbour.sent(), 1000);
}

TEST(AravisCamera, rejects_chunk_data_without_an_exposure_time) {
  const test::TemporaryFolder folder;
  const std::string description = folder / "genicam.xml";
  std::ofstream(description) << genicam_with_chunk("CRC");
  const FakeCamera fake(description.c_str());
  StudioCamera wanted = settings();
  wanted.trigger_line = "Line1";
  wanted.chunk_data = true;
  EXPECT_THAT(start_error(wanted), HasSubstr("ChunkSelector: expected ExposureTime"));
}

}  // namespace
}  // namespace v3d::capture
