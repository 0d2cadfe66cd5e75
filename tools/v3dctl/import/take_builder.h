// Writes a take that is whole from the start: under a temporary name beside its place, moved there
// when it is finished, removed when it is not.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "base/camera_model.h"
#include "base/frame.h"
#include "take/frame_log.h"
#include "take/take.h"

namespace v3d::ctl {

/// One thread.
class TakeBuilder {
 public:
  /// Throws InputError when `folder` exists, its name is no take name, or its parent is not
  /// writable.
  TakeBuilder(const std::filesystem::path& folder, std::vector<std::string> cameras, double rate_hz,
              const Rig& rig);
  ~TakeBuilder();
  TakeBuilder(const TakeBuilder&) = delete;
  TakeBuilder& operator=(const TakeBuilder&) = delete;

  /// Where background models go.
  std::filesystem::path background() const { return paths_.background(); }
  /// The next pulse: one picture of every camera, in the order of `cameras`. Throws
  /// std::runtime_error when the disk refuses.
  struct Shot {
    Image image;
    std::optional<Mask> mask;
  };
  void add_pulse(std::vector<Shot> shots);
  int64_t pulses() const { return pulses_; }
  /// Ledger, take.toml, and the move. Throws std::runtime_error when the disk refuses.
  void finish();

 private:
  FrameLabel label() const;

  std::filesystem::path folder_;
  TakePaths paths_;  // the temporary folder
  TakeInfo info_;
  std::optional<EventLogWriter> pulse_log_;
  std::vector<EventLogWriter> frame_logs_;
  int64_t pulses_ = 0;
  bool finished_ = false;
};

}  // namespace v3d::ctl
