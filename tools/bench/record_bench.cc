#include <cstdlib>
#include <filesystem>

#include "rates.h"
#include "take/logs/frame_log.h"
#include "workload.h"

namespace v3d::bench {
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
std::vector<FrameMessage> one_pulse() {
  std::vector<FrameMessage> messages(kCameras);
  for (int c = 0; c < kCameras; ++c) {
    messages[c].frame.camera = rig()[c].name;
    messages[c].frame.sensor_size = kSize;
    messages[c].frame.roi = {0, 0, kSize.width, kSize.height};
    messages[c].frame.image = raw_frames()[c];
  }
  return messages;
}

std::vector<EventLogWriter> new_logs(const ScratchFolder& folder,
                                     const std::vector<FrameMessage>& messages,
                                     LogHashing hashing = LogHashing::kChecksum) {
  folder.clear();
  std::vector<EventLogWriter> logs;
  for (const FrameMessage& m : messages) {
    logs.emplace_back(folder.path() / (m.frame.camera + ".lcmlog"), LogOpening::kNew, hashing);
  }
  return logs;
}

bool write_pulse(std::vector<EventLogWriter>& logs, std::vector<FrameMessage>& messages,
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
void record(benchmark::State& state, LogHashing hashing) {
  const ScratchFolder folder;
  std::vector<FrameMessage> messages = one_pulse();
  std::vector<EventLogWriter> logs;
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

BENCHMARK_CAPTURE(record, checksum, LogHashing::kChecksum)->Name("record/15xXGA");
BENCHMARK_CAPTURE(record, tree, LogHashing::kTree)->Name("record/15xXGA/signed");

// Writing to the disk with a sync: 100 pulses, 1.18 GB, and for comparison as much by dd with
// blocks of one frame. Run both alternately (docs/performance.md).
constexpr int64_t kSyncedPulses = 100;
constexpr double kSyncedFrames = kSyncedPulses * kCameras;

void record_to_disk(benchmark::State& state) {
  const ScratchFolder folder;
  std::vector<FrameMessage> messages = one_pulse();
  measure(state, kSyncedFrames, kSyncedFrames * static_cast<double>(kSize.pixels()), [&] {
    std::vector<EventLogWriter> logs = new_logs(folder, messages);
    bool written = true;
    for (int64_t pulse = 0; pulse < kSyncedPulses; ++pulse) {
      written = write_pulse(logs, messages, pulse) && written;
    }
    for (EventLogWriter& log : logs) written = log.sync().has_value() && written;
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
