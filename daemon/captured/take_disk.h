// Disk space and disk speed of a take: checked before recording, monitored while it runs.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>

#include "base/io/file.h"
#include "take/take.h"

namespace v3d::captured {

/// What a take needs from the disk.
struct DiskDemand {
  double rate_hz = 0;             ///< of the pulses
  double bytes_per_pulse = 0;     ///< over all cameras of the node
  std::optional<int64_t> pulses;  ///< empty: recorded until an operator stops it
  int64_t queue_frames = 0;       ///< queue length of a camera; more frames are dropped

  /// Bytes of the frames that may still arrive after the pulses have stopped.
  double bytes_in_flight() const { return bytes_per_pulse * static_cast<double>(queue_frames); }
};

/// Frames that did not reach the disk so far.
struct DiskErrors {
  int64_t dropped = 0;  ///< because a queue was full
  int64_t failed = 0;   ///< because of a write error
};

/// Empty when `free_bytes` are enough, else for example "needs 29.5 GB for 5 min, 12.1 GB free
/// ...", with the number of pulses that fit. A take without a length needs space for 5 min.
std::string space_shortage(const DiskDemand& demand, double free_bytes);

/// Why nothing can be recorded into the takes' folder: it does not exist (its disk is not mounted),
/// or is not writable. Names the folder; empty when it is good.
std::string folder_fault(const std::filesystem::path& takes);

/// Throws InputError, naming the folder, when it has a folder_fault() or too little space.
void check_disk(const std::filesystem::path& takes, const DiskDemand& demand);

/// Reads the free bytes of the disk of a folder: io::free_bytes(), or a replacement in tests.
using FreeSpaceReader = std::function<io::Result<uint64_t>(const std::filesystem::path&)>;

/// Monitors the disk from the beginning of a take until its ledger is written. One thread.
///
/// When the free space cannot be read, the take continues: stop_reason() is empty and warning() has
/// the cause.
class TakeDisk {
 public:
  /// Reserves 4 MiB for the ledger in the folder of the take, which exists. Throws InputError when
  /// the disk has no space for it.
  TakeDisk(take::TakePaths take, const DiskDemand& demand,
           FreeSpaceReader free_bytes = io::free_bytes);
  /// Frees the reserved space.
  ~TakeDisk();
  TakeDisk(const TakeDisk&) = delete;
  TakeDisk& operator=(const TakeDisk&) = delete;

  /// A pulse has at least this many bytes over all cameras of the node.
  void expect(double bytes_per_pulse);
  /// Why the pulses must stop now: a frame could not be written, or the free space is only enough
  /// for frames in flight. Empty: continue.
  std::string stop_reason(const DiskErrors& errors) const;
  /// Warns before frames are dropped: from the time half the queue is full until it is nearly
  /// empty (an eighth), with a constant text. `waiting`: length of the longest queue.
  std::string queue_warning(int64_t waiting);
  /// What is wrong with the disk, on one line; empty if nothing is.
  std::string warning(const DiskErrors& errors) const;

 private:
  /// Like io::type_of(): true when there is no take.toml.
  io::Result<bool> is_gone() const;
  std::string shortage_warning(double free_bytes) const;
  std::string takes() const { return take_.folder.parent_path().string(); }

  const take::TakePaths take_;
  DiskDemand demand_;
  const FreeSpaceReader free_bytes_;
  bool queue_is_full_ = false;
};

}  // namespace v3d::captured
