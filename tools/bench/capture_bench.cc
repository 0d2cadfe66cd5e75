#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <cstdlib>
#include <filesystem>

#include "capture/cameras/pixel_decoder.h"
#include "capture/sync/pulse_matcher.h"
#include "rates.h"
#include "take/logs/frame_log.h"
#include "workload.h"

namespace v3d::bench {
namespace {

/// Segments 15 raw frames into 15 masks.
void segment(benchmark::State& state) {
  std::vector<segmentation::Segmenter> segmenters;
  for (const segmentation::BackgroundModel& model : background_models()) {
    segmenters.emplace_back(model, segmentation::SegmentOptions{});
  }
  const std::vector<Image>& frames = raw_frames();
  tbb::task_arena arena(static_cast<int>(state.range(0)));
  const double bytes = static_cast<double>(kSize.pixels()) * kCameras;
  measure(state, kCameras, bytes, [&] {
    arena.execute([&] {
      tbb::parallel_for(0, kCameras, [&](int c) {
        benchmark::DoNotOptimize(segmenters[c].segment(frames[c].view()));
      });
    });
  });
}

/// Assigns pulses to the frames of a camera at 25 Hz whose clock is 100 ppm fast.
void match(benchmark::State& state) {
  const Duration period = period_of(25);
  const auto device_period = static_cast<int64_t>(static_cast<double>(period.count()) * 1.0001);
  capture::PulseMatcher matcher(period);
  int64_t frame = 0;
  measure(state, 1, 0, [&] {
    benchmark::DoNotOptimize(
        matcher.label({from_ns<DeviceClock>(frame * device_period), static_cast<uint64_t>(frame),
                       from_ns<Monotonic>(frame * period.count())}));
    ++frame;
  });
}

/// Bytes of an XGA image as a camera sends it.
std::vector<uint8_t> sent_image(CameraFormat format) {
  std::vector<uint8_t> bytes(row_bytes(format, kSize.width) * kSize.height);
  for (size_t i = 0; i < bytes.size(); ++i) bytes[i] = static_cast<uint8_t>(i * 37);
  return bytes;
}

/// Copies an image of 8 bits out of the buffer of the driver: the least that receiving takes.
void copy_image(benchmark::State& state) {
  const std::vector<uint8_t> bytes = sent_image(PixelFormat::kBayerRG8);
  measure(state, 1, static_cast<double>(bytes.size()), [&] {
    Image image;
    image.bytes.assign(bytes.begin(), bytes.end());
    benchmark::DoNotOptimize(image.bytes.data());
  });
}

/// What the capture threads do with an image in addition to recording: decode, then 8 bits.
void receive_image(benchmark::State& state, const char* format_name) {
  const CameraFormat format = *camera_format_from_name(format_name);
  const capture::SentLayout layout{format, kSize, row_bytes(format, kSize.width)};
  const std::vector<uint8_t> bytes = sent_image(format);
  measure(state, 1, static_cast<double>(bytes.size()), [&] {
    auto image = capture::decode_image(layout, bytes);
    reduce_to_8_bits(*image);
    benchmark::DoNotOptimize(image->bytes.data());
  });
}

BENCHMARK(copy_image)->Name("receive/XGA/copy");
BENCHMARK_CAPTURE(receive_image, BayerRG8, "BayerRG8")->Name("receive/XGA/BayerRG8");
BENCHMARK_CAPTURE(receive_image, BayerRG12, "BayerRG12")->Name("receive/XGA/BayerRG12");
BENCHMARK_CAPTURE(receive_image, Packed, "BayerRG12Packed")->Name("receive/XGA/BayerRG12Packed");
BENCHMARK_CAPTURE(receive_image, Yuyv, "YUYV")->Name("receive/XGA/YUYV");
BENCHMARK(segment)->Name("segment/15xXGA")->ArgName("threads")->Arg(1)->Arg(2);
BENCHMARK(match)->Name("match/frames");

}  // namespace

namespace {

/// Temporary folder; the destructor removes it.
class ScratchFolder {
 public:
  ScratchFolder() {
    std::string name = (std::filesystem::temp_directory_path() / "v3d-bench-XXXXXX").string();
    path_ = mkdtemp(name.data());
  }
  ~ScratchFolder() { std::filesystem::remove_all(path_); }
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;
  const std::filesystem::path& path() const { return path_; }
  void clear() const {
    for (const auto& entry : std::filesystem::directory_iterator(path_)) {
      std::filesystem::remove(entry);
    }
  }

 private:
  std::filesystem::path path_;
};

/// Raw frames of all cameras at one pulse.
std::vector<wire::FrameMessage> one_pulse() {
  std::vector<wire::FrameMessage> messages(kCameras);
  for (int c = 0; c < kCameras; ++c) {
    messages[c].frame.camera = rig()[c].name;
    messages[c].frame.sensor_size = kSize;
    messages[c].frame.roi = {0, 0, kSize.width, kSize.height};
    messages[c].frame.image = raw_frames()[c];
  }
  return messages;
}

std::vector<take::EventLogWriter> new_logs(const ScratchFolder& folder,
                                           const std::vector<wire::FrameMessage>& messages,
                                           take::LogHashing hashing = take::LogHashing::kChecksum) {
  folder.clear();
  std::vector<take::EventLogWriter> logs;
  for (const wire::FrameMessage& m : messages) {
    logs.emplace_back(folder.path() / (m.frame.camera + ".lcmlog"), take::LogOpening::kNew,
                      hashing);
  }
  return logs;
}

bool write_pulse(std::vector<take::EventLogWriter>& logs, std::vector<wire::FrameMessage>& messages,
                 int64_t pulse) {
  bool written = true;
  for (int c = 0; c < kCameras; ++c) {
    messages[c].frame.label.pulse = pulse;
    written = logs[c].write(messages[c]).has_value() && written;
  }
  return written;
}

/// Writes one pulse of raw frames into 15 event logs, as v3d-captured does, without a sync to the
/// disk. New logs are opened every 25 pulses, so that a run needs 300 MB.
void record(benchmark::State& state, take::LogHashing hashing) {
  const ScratchFolder folder;
  std::vector<wire::FrameMessage> messages = one_pulse();
  std::vector<take::EventLogWriter> logs;
  int64_t pulse = 0;
  const double bytes = static_cast<double>(kSize.pixels()) * kCameras;
  measure(state, kCameras, bytes, [&] {
    if (pulse % 25 == 0) {
      logs.clear();
      logs = new_logs(folder, messages, hashing);
    }
    if (!write_pulse(logs, messages, pulse++)) state.SkipWithError("a log cannot be written");
  });
}

BENCHMARK_CAPTURE(record, checksum, take::LogHashing::kChecksum)->Name("record/15xXGA");
BENCHMARK_CAPTURE(record, tree, take::LogHashing::kTree)->Name("record/15xXGA/signed");

// Writing to the disk with a sync: 100 pulses, 1.18 GB, and for comparison as much by dd with
// blocks of one frame. Run both alternately (docs/performance.md).
constexpr int64_t kSyncedPulses = 100;
constexpr double kSyncedFrames = kSyncedPulses * kCameras;

void record_to_disk(benchmark::State& state) {
  const ScratchFolder folder;
  std::vector<wire::FrameMessage> messages = one_pulse();
  measure(state, kSyncedFrames, kSyncedFrames * static_cast<double>(kSize.pixels()), [&] {
    std::vector<take::EventLogWriter> logs = new_logs(folder, messages);
    bool written = true;
    for (int64_t pulse = 0; pulse < kSyncedPulses; ++pulse) {
      written = write_pulse(logs, messages, pulse) && written;
    }
    for (take::EventLogWriter& log : logs) written = log.sync().has_value() && written;
    if (!written) state.SkipWithError("a log cannot be written");
  });
}

BENCHMARK(record_to_disk)->Name("record/15xXGA/to_disk")->Iterations(1);

/// dd writes zeros, so it reads no disk.
void dd(benchmark::State& state) {
  const ScratchFolder folder;
  const std::string command = "dd if=/dev/zero of=" + (folder.path() / "dd").string() +
                              " bs=" + std::to_string(kSize.pixels()) +
                              " count=" + std::to_string(kSyncedPulses * kCameras) +
                              " conv=fdatasync status=none";
  measure(state, kSyncedFrames, kSyncedFrames * static_cast<double>(kSize.pixels()), [&] {
    if (std::system(command.c_str()) != 0) state.SkipWithError("dd failed");
  });
}

BENCHMARK(dd)->Name("record/dd")->Iterations(1);

}  // namespace

}  // namespace v3d::bench
