// The live way of a take through the reconstruction: frames in, meshes out.
#pragma once

#include <atomic>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "base/studio_file.h"
#include "daemon/bounded_queue.h"
#include "daemon/bus.h"
#include "daemon/heartbeat.h"
#include "recon/frame_set.h"
#include "recon/reconstructor.h"
#include "take/mesh_file.h"

namespace v3d {

struct ReconCounts {
  int64_t meshes = 0;
  int64_t dropped = 0;          ///< pulses skipped because this machine could not keep up
  int64_t incomplete_sets = 0;  ///< went on without some cameras
  int64_t foreign = 0;          ///< frames of other takes
  int64_t frames_lost = 0;      ///< sent, and never arrived here
  int64_t undecodable = 0;
  int64_t write_errors = 0;
  double latency_p50_ms = 0;  ///< pulse to mesh published, over the last kLatencies meshes
  double latency_p99_ms = 0;
  double live_fps = 0;  ///< meshes per second over the take so far
};

/// Lives from the moment a take is armed until it is closed. Two threads: one assembles frame sets,
/// one reconstructs. When the second cannot keep up, whole pulses are dropped, the oldest waiting
/// one first, and counted: live is live.
class ReconPipeline {
 public:
  struct Setup {
    std::string take;
    std::filesystem::path mesh_file;
    Rig rig;
    ReconstructOptions options;
    FrameSetOptions sets;
  };
  /// `bus` outlives the pipeline. Throws InputError when the grid does not fit into memory or the
  /// mesh file cannot be made.
  ReconPipeline(Setup setup, Bus& bus);
  ~ReconPipeline();
  ReconPipeline(const ReconPipeline&) = delete;
  ReconPipeline& operator=(const ReconPipeline&) = delete;

  ReconCounts counts() const;
  /// The highest pulse number that the trigger's node told of, plus one.
  int64_t pulses_seen() const { return pulses_seen_; }
  /// Everything that came has been reconstructed or dropped, and nothing has come for `quiet`.
  bool drained(Duration quiet) const;
  bool progressed_since(MonotonicInstant since) const {
    return assembling_.since(since) && reconstructing_.since(since);
  }
  /// Ends the threads and closes the mesh file; false when the disk refused.
  bool close();

 private:
  static constexpr size_t kLatencies = 1000;

  void assemble();
  void reconstruct();
  void hand_over(std::vector<ReadySet> ready);
  void note_pulses();
  void work_on(const ReadySet& ready);
  void publish(const Reconstruction& result, const ReadySet& ready);
  RealtimeInstant edge_of(int64_t pulse);
  void note_latency(RealtimeInstant edge);
  void end();

  const std::string take_;
  Bus& bus_;
  Reconstructor reconstructor_;  ///< reconstructing thread
  FrameSetAssembler assembler_;  ///< assembling thread
  MeshFileWriter file_;
  Subscription<FrameMessage> frames_;
  Subscription<PulseMessage> pulses_;
  BoundedQueue<ReadySet> ready_;
  int64_t seq_ = 0;

  std::atomic<int64_t> meshes_ = 0;
  std::atomic<int64_t> handed_over_ = 0;
  std::atomic<int64_t> incomplete_ = 0;
  std::atomic<int64_t> foreign_ = 0;
  std::atomic<int64_t> write_errors_ = 0;
  std::atomic<int64_t> open_sets_ = 0;
  std::atomic<int64_t> pulses_seen_ = 0;
  std::atomic<int64_t> last_frame_ns_ = 0;
  Heartbeat assembling_;
  Heartbeat reconstructing_;

  mutable std::mutex mutex_;  ///< what follows
  std::map<int64_t, RealtimeInstant> edges_;
  std::vector<double> latencies_ms_;
  size_t next_latency_ = 0;
  MonotonicInstant first_mesh_;
  MonotonicInstant last_mesh_;

  std::atomic<bool> stopping_ = false;
  std::thread assembling_thread_;
  std::thread reconstructing_thread_;
};

}  // namespace v3d
