#include <cstdlib>
#include <filesystem>

#include "rates.h"
#include "take/frame_log.h"
#include "workload.h"

namespace v3d::bench {
namespace {

/// A folder that goes away with the object.
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

 private:
  std::filesystem::path path_;
};

/// One pulse of raw frames into 15 event logs, as v3d-captured writes them; to the file system, not
/// to the platter. The logs begin anew every 25 pulses so that a run needs 300 MB.
void record(benchmark::State& state) {
  const ScratchFolder folder;
  std::vector<FrameMessage> messages(kCameras);
  for (int c = 0; c < kCameras; ++c) {
    messages[c].frame.camera = rig()[c].name;
    messages[c].frame.sensor_size = kSize;
    messages[c].frame.roi = {0, 0, kSize.width, kSize.height};
    messages[c].frame.image = raw_frames()[c];
  }
  std::vector<EventLogWriter> logs;
  int64_t pulse = 0;
  const double bytes = static_cast<double>(kSize.pixels()) * kCameras;
  measure(state, kCameras, bytes, [&] {
    if (pulse % 25 == 0) {
      logs.clear();
      for (const FrameMessage& m : messages) {
        logs.emplace_back(folder.path() / (m.frame.camera + ".lcmlog"));
      }
    }
    for (int c = 0; c < kCameras; ++c) {
      messages[c].frame.label.pulse = pulse;
      if (!logs[c].write(messages[c])) {
        state.SkipWithError("the disk refused");
      }
    }
    ++pulse;
  });
}

BENCHMARK(record)->Name("record/15xXGA");

}  // namespace
}  // namespace v3d::bench
