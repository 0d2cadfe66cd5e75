// The live way of a take through the reconstruction: frames in, meshes out.
#pragma once

#include <atomic>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "base/studio_file.h"
#include "daemon/bus/bus.h"
#include "daemon/node/heartbeat.h"
#include "daemon/recond/live_queue.h"
#include "daemon/recond/queue_idle_timer.h"
#include "daemon/recond/shared_take.h"
#include "recon/pipeline/frame_pipeline.h"
#include "recon/pipeline/frame_set.h"
#include "recon/pipeline/reconstructor.h"
#include "take/logs/mesh_file.h"

namespace v3d {

struct ReconCounts {
  int64_t meshes = 0;
  int64_t dropped = 0;          ///< pulses skipped because this machine could not keep up
  int64_t waiting = 0;          ///< frame sets that nobody works on yet
  bool behind = false;          ///< drops pulses, or did so not long ago
  int64_t failed = 0;           ///< pulses whose surface cannot be a compact frame
  std::string failure;          ///< why, for the last of them
  int64_t incomplete_sets = 0;  ///< went on without some cameras
  int64_t foreign = 0;          ///< frames of other takes
  int64_t frames_late = 0;      ///< arrived when their set had gone
  int64_t frames_lost = 0;      ///< sent, and never arrived here; or dropped here, unseen
  int64_t frames_dropped = 0;   ///< of these, dropped here because nobody took them in time
  std::map<std::string, SequenceCounts> cameras;  ///< the frames of each, by sequence
  int64_t undecodable = 0;
  int64_t write_errors = 0;
  double latency_p50_ms = 0;  ///< pulse to mesh published, over the last kLatencies meshes
  double latency_p99_ms = 0;
  double live_fps = 0;     ///< meshes per second over the take so far
  FrameQuality quality{};  ///< of the last mesh
  /// Of a take that several nodes share; `meshes`, latencies and quality are then of all of them.
  std::optional<ShardCounts> shard{};
  std::vector<int64_t> without_mesh{};  ///< the pulses of such a take that have no mesh
};

/// What is done with a frame set: Reconstructor's two stages. They throw InputError for a set that
/// cannot become a compact frame.
struct MeshStages {
  std::function<void(FrameSetJob&)> make_mesh;
  std::function<void(FrameSetJob&)> encode;
  /// What was encoded before the next set has not reached, or not all of, its receivers.
  std::function<void()> begin_sequence = [] {};
};
/// The stages keep the reconstructor alive, as std::functions keep what they call.
MeshStages stages_of(const std::shared_ptr<Reconstructor>& reconstructor);

/// Lives from the moment a take is armed until it is closed. A thread assembles frame sets; two
/// stages of a FramePipeline make meshes of them, so that a set is begun while the one before is
/// encoded and published. When they cannot keep up, whole pulses are dropped by LiveQueue's rule
/// and counted. A pulse whose stage refuses it is counted, told in the log, and has no mesh.
/// Where nodes share the take, the stages get this node's share (daemon/recond/shard.h), every mesh
/// is a key frame, since nobody knows whose is the one before, and the file has the meshes of all.
class ReconPipeline {
 public:
  struct Setup {
    std::string take;
    std::filesystem::path mesh_file;
    MeshStages stages;
    int threads = 0;  ///< 0: one per core
    FrameSetOptions sets;
    std::optional<FrameSet> rehearsal{};  ///< worked on first; its mesh is thrown away
    /// Gets every set whose mesh has been published, on the last stage's thread: what is left of it
    /// is nobody's.
    std::function<void(FrameSet&)> done_with{};
    /// A take that goes on: pulses of it until now. The mesh file goes on behind its last mesh.
    std::optional<int64_t> goes_on_at{};
    /// Where several nodes share the take.
    std::optional<Shard::Setup> shard{};
  };
  /// `bus` outlives the pipeline. Throws InputError when the mesh file cannot be made.
  ReconPipeline(Setup setup, Bus& bus);
  ~ReconPipeline();
  ReconPipeline(const ReconPipeline&) = delete;
  ReconPipeline& operator=(const ReconPipeline&) = delete;

  ReconCounts counts() const;
  /// Everything that came has been reconstructed or dropped, and nothing has come for `quiet`, as
  /// of the assembling thread's last look.
  bool drained(Duration quiet) const;
  bool progressed_since(MonotonicInstant since) const {
    return assembling_.beat_since(since) && reconstructing_.beat_since(since) &&
           (!shared_ || shared_->progressed_since(since));
  }
  /// Ends the threads and closes the mesh file; what still waits is dropped. False when the disk
  /// refused.
  bool close();

 private:
  static constexpr size_t kLatencies = 1000;

  /// A frame set in the pipeline.
  struct Job {
    FrameSetJob work;
    std::vector<std::string> missing;
    std::string failure;  ///< why it has no mesh; empty as long as it may have one
    bool rehearsal = false;
  };

  std::unique_ptr<SharedTake> share(const std::optional<Shard::Setup>& setup);
  void assemble();
  void hear(const FrameGroupSet& groups);
  std::string series_of(const std::string& camera, size_t group) const;
  void note_arrival(const FrameMessage& message);
  void hand_over(std::vector<ReadySet> ready);
  void note_pulses();
  std::optional<Job> next_job();
  void attempt(const std::function<void(FrameSetJob&)>& stage, Job& job);
  void finish(Job& job);
  void note_failure(const Job& job);
  MeshMessage message_of(const Job& job);
  bool keep(const MeshMessage& mesh);
  RealtimeInstant edge_of(int64_t pulse);
  void note_mesh(const MeshMessage& mesh);
  void note_latency(RealtimeInstant edge);
  void end();

  const std::string take_;
  const std::vector<std::string> cameras_;
  Bus& bus_;
  const MeshStages stages_;
  const std::function<void(FrameSet&)> done_with_;
  MeshFileWriter file_;
  const int64_t meshes_before_;  ///< in the file, of a take that goes on
  FrameSetAssembler assembler_;  ///< assembling thread
  Subscription<FrameMessage> frames_;
  Subscription<PulseMessage> pulses_;
  LiveQueue<ReadySet> ready_;
  std::optional<FrameSet> rehearsal_;  ///< until it is worked on
  int64_t seq_ = 0;                    ///< last stage
  int64_t newest_pulse_ = 0;           ///< assembling thread

  std::atomic<int64_t> meshes_ = 0;
  std::atomic<int64_t> failed_ = 0;
  std::atomic<int64_t> handed_over_ = 0;
  std::atomic<int64_t> incomplete_ = 0;
  std::atomic<int64_t> foreign_ = 0;
  std::atomic<int64_t> late_ = 0;
  std::atomic<int64_t> write_errors_ = 0;
  std::atomic<int64_t> open_sets_ = 0;
  QueueIdleTimer quiet_;  ///< of frames_
  Heartbeat assembling_;
  Heartbeat reconstructing_;

  mutable std::mutex mutex_;              ///< what follows
  SequenceTracker sequences_;             ///< by camera and frame group
  std::optional<FrameGroupSet> heard_{};  ///< what a shared take hears
  std::map<int64_t, RealtimeInstant> edges_;
  std::vector<double> latencies_ms_;
  size_t next_latency_ = 0;
  MonotonicInstant first_mesh_;
  MonotonicInstant last_mesh_;
  std::string failure_;
  FrameQuality quality_;

  std::unique_ptr<SharedTake> shared_;  ///< where several nodes share the take
  std::atomic<bool> stopping_ = false;
  std::thread assembling_thread_;
  FramePipeline<Job> pipeline_;  ///< last: it works with all of the above
};

}  // namespace v3d
