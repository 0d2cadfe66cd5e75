// The disk that a take is written to: whether it has room, and how it goes while the take is
// recorded.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "take/take.h"

namespace v3d {

/// What a take asks of the disk.
struct DiskDemand {
  double rate_hz = 0;             ///< pulses
  double bytes_per_pulse = 0;     ///< of all cameras of the node
  std::optional<int64_t> pulses;  ///< empty: until somebody stops it
  int64_t queue_frames = 0;  ///< of one camera, that wait for the disk before frames are dropped

  /// Frames that may still be on their way when the pulses are stopped.
  double bytes_in_flight() const { return bytes_per_pulse * static_cast<double>(queue_frames); }
};

/// How a take's recording goes.
struct DiskProgress {
  int64_t dropped = 0;  ///< frames for which the queue was full
  int64_t refused = 0;  ///< frames that the disk did not take
};

/// "needs 29.5 GB for 5 min, 12.1 GB free ...", with what would fit; empty when `free_bytes` are
/// enough. A take of no given length needs room for five minutes.
std::string lack_of_room(const DiskDemand& demand, double free_bytes);

/// Throws InputError, naming the folder, when the takes' folder is not there (its disk is not
/// mounted), cannot be written to or lacks room.
void refuse_unfit_disk(const std::filesystem::path& takes, const DiskDemand& demand);

/// From the beginning of a take until its ledger is written. One thread.
class TakeDisk {
 public:
  /// Sets room for the ledger aside in the folder of the take, which exists. Throws InputError when
  /// there is none.
  TakeDisk(TakePaths take, const DiskDemand& demand);
  /// Gives it back.
  ~TakeDisk();
  TakeDisk(const TakeDisk&) = delete;
  TakeDisk& operator=(const TakeDisk&) = delete;

  /// Why the pulses must end now: the disk refused a frame, or there is just room for the frames on
  /// their way. Empty: go on.
  std::string must_end(const DiskProgress& progress) const;
  /// Told before the first frame is dropped: half the queue is full. The same text until it is
  /// nearly empty again.
  std::string queue_trouble(int64_t waiting);
  /// What is wrong with the disk, one line; empty when nothing is.
  std::string trouble(const DiskProgress& progress) const;

 private:
  double free_bytes() const;
  std::string takes() const { return take_.folder.parent_path().string(); }

  const TakePaths take_;
  const DiskDemand demand_;
  bool behind_ = false;
};

}  // namespace v3d
