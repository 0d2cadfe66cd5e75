// The live reconstruction of one take: receives frames, makes meshes, publishes and writes them.
#pragma once

#include <atomic>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "base/config/studio_file.h"
#include "base/config/studio_values.h"
#include "daemon/bus/bus.h"
#include "daemon/node/service.h"
#include "daemon/recond/live_queue.h"
#include "daemon/recond/live_repair.h"
#include "daemon/recond/pass_load_control.h"
#include "daemon/recond/shared_take.h"
#include "recon/performers/performer_labeller.h"
#include "recon/pipeline/frame_pipeline.h"
#include "recon/pipeline/frame_set.h"
#include "recon/pipeline/reconstructor.h"
#include "take/logs/mesh_file.h"

namespace v3d::recond {

/// How many pulses may wait for frames at a time, so that each can wait for `deadline`: 16 to 64,
/// because their frames are in memory.
int open_sets_of(Duration deadline, double rate_hz);

struct ReconCounts {
  int64_t meshes = 0;
  int64_t dropped = 0;          ///< pulses dropped because this machine could not keep up
  int64_t waiting = 0;          ///< frame sets in the queue
  bool behind = false;          ///< LiveQueue::behind()
  int64_t failed = 0;           ///< pulses whose surface cannot be a compact frame
  std::string failure;          ///< why, for the last of them
  int64_t incomplete_sets = 0;  ///< sets processed without some cameras
  int64_t foreign = 0;          ///< frames of other takes
  int64_t frames_late = 0;      ///< arrived after their set was complete or overdue
  int64_t frames_lost = 0;      ///< sent, but not received, or dropped by the receive queue
  int64_t frames_dropped = 0;   ///< of these, dropped by the receive queue
  std::map<std::string, bus::SequenceCounts> cameras;  ///< frames by camera
  int64_t ghosts = 0;                                  ///< components removed by GhostRemoval
  int64_t undecodable = 0;
  /// Ignored frames, pulses and meshes: their pulse is not in PlausiblePulses.
  int64_t implausible = 0;
  int64_t write_errors = 0;
  double latency_p50_ms = 0;  ///< pulse to mesh published, over the last kLatencies meshes
  double latency_p99_ms = 0;
  double live_fps = 0;                   ///< meshes per second over the take so far
  recon::FrameQuality quality{};         ///< of the last mesh
  std::optional<RepairCounts> repair{};  ///< set where silhouettes are repaired
  std::optional<int64_t> performers{};   ///< in the last mesh; set where meshes have labels
  /// Meshes of this node by passes of the live deformation; empty where it has none.
  std::vector<int64_t> by_passes{};
  /// Set where several nodes share the take. Then `meshes`, latencies and quality cover all nodes.
  std::optional<ShardCounts> shard{};
  std::vector<int64_t> without_mesh{};  ///< pulses of a shared take
  /// Why a shared take cannot receive a frame group, which is tried again; empty: it receives all.
  std::string join_failure{};
};

/// The stages that process a frame set: those of Reconstructor. They throw InputError for a set
/// whose mesh cannot be a compact frame.
struct MeshStages {
  std::function<void(recon::FrameSetJob&)> make_mesh;
  std::function<void(recon::FrameSetJob&)> encode;
  /// Makes the next mesh a key frame: some receiver lacks the previous one.
  std::function<void()> begin_sequence = [] {};
};
/// The stages of `reconstructor`, which they share ownership of.
MeshStages stages_of(const std::shared_ptr<recon::Reconstructor>& reconstructor);

/// The reconstruction of one take, from arming until closing.
///
/// One thread assembles frame sets. Two stages of a FramePipeline make meshes of them, so that the
/// next set starts while the previous mesh is encoded and published. When the stages are too slow,
/// LiveQueue drops whole pulses and counts them. A pulse whose stage throws is counted, logged, and
/// has no mesh.
///
/// Where several nodes share the take, the stages get the sets of this node (daemon/recond/shard.h)
/// and the file gets the meshes of all. Every mesh is then a key frame, because the previous mesh
/// may come from another node.
class ReconPipeline {
 public:
  struct Setup {
    std::string take;
    std::filesystem::path mesh_file;
    MeshStages stages;
    int threads = 0;  ///< 0: one per core
    recon::FrameSetOptions sets;
    std::optional<recon::FrameSet> warm_up{};  ///< processed first, to allocate memory; has no mesh
    std::optional<LiveRepair::Setup> repair{};  ///< of silhouettes, in the first stage
    int live_passes = 0;  ///< of the live deformation, for a pulse with enough time
    /// Labels the vertices of the meshes with their performers, in the last stage. Requires a take
    /// that is not shared. Identities begin with 1, also in a resumed take.
    bool performers = false;
    /// Called when a set enters the stages, and when it has left them, with or without a mesh. By
    /// several threads.
    std::function<void()> on_set_begins = [] {};
    std::function<void()> on_set_ends = [] {};
    /// Receives every set whose mesh was published, with its silhouettes before the repair, and may
    /// modify it. Called by the last stage.
    std::function<void(recon::FrameSet&)> on_finished_set{};
    /// Set for a take that is resumed after a restart: its pulses so far. Meshes are appended to
    /// the file.
    std::optional<int64_t> resume_at{};
    /// Set where several nodes share the take.
    std::optional<Shard::Setup> shard{};
  };
  /// `bus` must outlive the pipeline. Throws InputError when the mesh file cannot be created.
  ReconPipeline(Setup setup, bus::Bus& bus);
  ~ReconPipeline();  ///< closes; an error is logged
  ReconPipeline(const ReconPipeline&) = delete;
  ReconPipeline& operator=(const ReconPipeline&) = delete;

  /// The number of the last pulse of the train, as its node reports it. A shared take waits for its
  /// mesh, also where no sense line reports pulses. Any thread.
  void on_last_pulse(int64_t pulse);
  ReconCounts counts() const;
  /// Was every received set reconstructed or dropped, and was no frame received for `idle_time`
  /// when the assembling thread last checked?
  bool drained(Duration idle_time) const;
  bool progressed_since(MonotonicInstant since) const {
    return assembling_.beat_since(since) && reconstructing_.beat_since(since) &&
           (!shared_ || shared_->progressed_since(since));
  }
  /// Ends the threads, drops the sets that wait, and closes the mesh file. Fails with path and
  /// cause when meshes or their index may not be on the disk; a repeated call returns the same.
  [[nodiscard]] io::Status close();

 private:
  static constexpr size_t kLatencies = 1000;

  /// A frame set in the pipeline.
  struct Job {
    recon::FrameSetJob work;
    std::vector<std::string> missing;
    std::string failure;  ///< why it has no mesh; empty: no failure so far
    bool is_warm_up = false;
    std::vector<recon::ReplacedMask> replaced{};  ///< by the silhouette repair
  };

  std::unique_ptr<SharedTake> make_shared_take(const std::optional<Shard::Setup>& setup);
  std::unique_ptr<LiveRepair> make_repair(std::optional<LiveRepair::Setup> setup);
  void assemble();
  bool receive_groups(const bus::FrameGroupSet& groups);
  std::string series_of(const std::string& camera, size_t group) const;
  void record_arrival(const wire::FrameMessage& message);
  void dispatch(std::vector<recon::ReadySet> ready);
  void record_pulses();
  std::optional<Job> next_job();
  void run_stage(const std::function<void(recon::FrameSetJob&)>& stage, Job& job);
  void repair(Job& job);
  void limit_passes(Job& job);
  void make_mesh(Job& job);
  void encode_mesh(Job& job);
  void finish(Job& job);
  void record_failure(const Job& job);
  wire::MeshMessage message_of(const Job& job);
  bool store(const wire::MeshMessage& mesh);
  RealtimeInstant edge_of(int64_t pulse);
  void record_mesh(const wire::MeshMessage& mesh);
  void record_latency(RealtimeInstant edge);
  void stop();

  const std::string take_;
  const std::vector<std::string> cameras_;
  bus::Bus& bus_;
  const MeshStages stages_;
  const std::function<void()> on_set_begins_;
  const std::function<void()> on_set_ends_;
  const std::function<void(recon::FrameSet&)> on_finished_set_;
  take::MeshFileWriter file_;
  const int64_t meshes_before_;         ///< in the file of a resumed take
  recon::FrameSetAssembler assembler_;  ///< used by the assembling thread
  bus::Subscription<wire::FrameMessage> frames_;
  bus::Subscription<wire::PulseMessage> pulses_;
  LiveQueue<recon::ReadySet> ready_;
  std::optional<recon::FrameSet> warm_up_;  ///< empty once it is processed
  int64_t seq_ = 0;                         ///< used by the last stage
  PlausiblePulses plausible_;               ///< of pulses_; used by the assembling thread

  std::atomic<int64_t> meshes_ = 0;
  std::atomic<int64_t> ghosts_ = 0;
  std::atomic<int64_t> failed_ = 0;
  std::atomic<int64_t> dispatched_ = 0;
  std::atomic<int64_t> incomplete_ = 0;
  std::atomic<int64_t> foreign_ = 0;
  std::atomic<int64_t> late_ = 0;
  std::atomic<int64_t> implausible_frames_ = 0;
  std::atomic<int64_t> implausible_pulses_ = 0;
  std::atomic<int64_t> write_errors_ = 0;
  std::atomic<int64_t> open_sets_ = 0;
  QueueIdleTimer idle_;  ///< of frames_
  node::Heartbeat assembling_;
  node::Heartbeat reconstructing_;

  mutable std::mutex mutex_;                    ///< guards the members below, until shared_
  bus::SequenceTracker sequences_;              ///< by camera and frame group
  std::optional<bus::FrameGroupSet> groups_{};  ///< that a shared take receives
  std::string join_failure_;  ///< why it cannot receive a frame group; empty: it receives all
  std::map<int64_t, RealtimeInstant> edges_;
  std::vector<double> latencies_ms_;
  size_t next_latency_ = 0;
  MonotonicInstant first_mesh_;
  MonotonicInstant last_mesh_;
  std::string failure_;
  recon::FrameQuality quality_;

  const int max_passes_;
  PassLoadControl passes_;                       ///< used by the first stage
  std::vector<std::atomic<int64_t>> by_passes_;  ///< meshes; without passes one number
  std::unique_ptr<LiveRepair> repair_;           ///< null where silhouettes are not repaired
  /// Used by the last stage; null where meshes have no labels.
  const std::unique_ptr<recon::PerformerLabeller> labeller_;
  std::atomic<int64_t> performers_ = 0;  ///< in the last mesh
  std::unique_ptr<SharedTake> shared_;   ///< null where one node makes all meshes
  std::atomic<bool> stopping_ = false;
  std::thread assembling_thread_;
  recon::FramePipeline<Job> pipeline_;  ///< last: it uses all of the above
};

}  // namespace v3d::recond
