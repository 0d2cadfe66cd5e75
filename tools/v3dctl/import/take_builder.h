// Builder of complete takes from images, for the import.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "base/geometry/camera_model.h"
#include "base/image/frame.h"
#include "take/logs/frame_log.h"
#include "take/take.h"

namespace v3d::ctl {

/// Writes a take under a temporary name in the same folder until finish(); the destructor removes
/// an unfinished take. One thread.
class TakeBuilder {
 public:
  /// Throws InputError if `folder` exists, if its name is no take name, or if its parent is not
  /// writable.
  TakeBuilder(const std::filesystem::path& folder, std::vector<std::string> cameras, double rate_hz,
              const Rig& rig);
  ~TakeBuilder();
  TakeBuilder(const TakeBuilder&) = delete;
  TakeBuilder& operator=(const TakeBuilder&) = delete;

  /// Folder for background models.
  std::filesystem::path background() const { return paths_.background(); }
  struct Shot {
    Image image;
    std::optional<Mask> mask;
  };
  /// Adds a pulse: one image of each camera, in the order of `cameras`. Throws std::runtime_error
  /// for errors of the disk.
  void add_pulse(std::vector<Shot> shots);
  int64_t pulses() const { return pulses_; }
  /// Writes ledger and take.toml, and renames the take. Throws std::runtime_error for errors of the
  /// disk.
  void finish();

 private:
  FrameLabel label() const;

  std::filesystem::path folder_;
  TakePaths paths_;  ///< in the temporary folder
  TakeInfo info_;
  std::optional<EventLogWriter> pulse_log_;
  std::vector<EventLogWriter> frame_logs_;
  int64_t pulses_ = 0;
  bool finished_ = false;
};

}  // namespace v3d::ctl
