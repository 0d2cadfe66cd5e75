#include "daemon/recond/recon_node.h"

#include <malloc.h>

#include <algorithm>

#include "base/calib_file.h"
#include "base/error.h"
#include "base/units.h"
#include "daemon/control/reply_json.h"
#include "daemon/node/advice.h"
#include "daemon/node/service.h"
#include "daemon/node/take_folder.h"
#include "recon/pipeline/frame_set.h"
#include "take/ledger/ledger.h"
#include "take/take_removal.h"

namespace v3d {
namespace {

/// The capture nodes drain at the same time: the last frames come within this.
constexpr Duration kQuiet = std::chrono::milliseconds(1200);
constexpr Duration kDrainWithin = std::chrono::seconds(20);

/// A camera that was knocked once more is told again.
constexpr double kOtherShiftPx = 1;

std::map<std::string, double> values_of(const ShardCounts& c) {
  return {{"shard_pulses", static_cast<double>(c.made)},
          {"shard_taken_over", static_cast<double>(c.taken_over)},
          {"shard_repeated", static_cast<double>(c.repeated)},
          {"shard_duplicates", static_cast<double>(c.duplicates)},
          {"shard_let_go", static_cast<double>(c.let_go)},
          {"shard_given_up", static_cast<double>(c.given_up)},
          {"shard_lost", static_cast<double>(c.lost)},
          {"shard_nodes", static_cast<double>(c.living)}};
}

/// The last ones of many.
std::string last_of(const std::vector<int64_t>& pulses) {
  constexpr ptrdiff_t kTold = 24;
  if (std::ssize(pulses) <= kTold) return number_ranges(pulses);
  return format_count(std::ssize(pulses)) + " pulses, the last " +
         number_ranges({pulses.end() - kTold, pulses.end()});
}

/// What this node did of a shared take, in words.
std::string share_text(const ReconCounts& counts) {
  if (!counts.shard) return "";
  const std::vector<int64_t>& without = counts.without_mesh;
  return ", " + format_count(counts.shard->made) + " made here, " +
         format_count(counts.shard->taken_over) + " taken over" +
         (without.empty() ? "" : "; no mesh of " + last_of(without));
}

std::map<std::string, double> values_of(const ReconCounts& c) {
  std::map<std::string, double> values = {
      {"meshes", static_cast<double>(c.meshes)},
      {"dropped", static_cast<double>(c.dropped)},
      {"queue_sets", static_cast<double>(c.waiting)},
      {"failed", static_cast<double>(c.failed)},
      {"incomplete_sets", static_cast<double>(c.incomplete_sets)},
      {"frames_foreign", static_cast<double>(c.foreign)},
      {"frames_lost", static_cast<double>(c.frames_lost)},
      {"frames_late", static_cast<double>(c.frames_late)},
      {"frames_dropped", static_cast<double>(c.frames_dropped)},
      {"undecodable", static_cast<double>(c.undecodable)},
      {"write_errors", static_cast<double>(c.write_errors)},
      {"latency_p50_ms", c.latency_p50_ms},
      {"latency_p99_ms", c.latency_p99_ms},
      {"live_fps", c.live_fps}};
  if (c.meshes > 0) {
    values["silhouette_iou_percent"] = 100 * c.quality.silhouette_iou;
    values["coverage_percent"] = 100 * c.quality.coverage;
  }
  if (c.shard) values.merge(values_of(*c.shard));
  for (const auto& [camera, frames] : c.cameras) {
    values[camera + ".live_received"] = static_cast<double>(frames.received);
    values[camera + ".live_lost"] = static_cast<double>(frames.lost);
    values[camera + ".live_late"] = static_cast<double>(frames.late);
  }
  return values;
}

std::string detail_of(const ReconCounts& counts) {
  if (!counts.shard) return numbers_json(values_of(counts));
  return recon_json(values_of(counts), counts.without_mesh);
}

/// The cameras that this take may count on.
FrameSetOptions sets_of(const Studio& studio, const CommandMessage& order) {
  FrameSetOptions options;
  for (const StudioCamera& camera : studio.cameras) {
    const bool missing = std::find(order.allow_missing.begin(), order.allow_missing.end(),
                                   camera.name) != order.allow_missing.end();
    if (!missing) options.cameras.push_back(camera.name);
  }
  options.deadline = from_seconds(studio.reconstruction.deadline_ms * 1e-3);
  return options;
}

/// Their calibration, in their order: as `v3dctl reconstruct` takes it from the take.
Rig rig_of(const std::vector<std::string>& cameras, const std::filesystem::path& calib) {
  const Rig all = load_calib(calib);
  Rig rig;
  for (const std::string& camera : cameras) {
    const int index = find_camera(all, camera);
    if (index < 0) throw InputError(calib.string() + ": has no camera '" + camera + "'");
    rig.push_back(all[static_cast<size_t>(index)]);
  }
  return rig;
}

}  // namespace

ReconNode::ReconNode(const Studio& studio, const std::string& node, Bus& bus)
    : studio_(studio),
      node_(node),
      bus_(bus),
      events_(bus, node),
      train_(bus, studio.trigger.node),
      kept_orders_(studio, node) {}

ReconNode::~ReconNode() { disarm(); }

void ReconNode::arm(const CommandMessage& order) {
  kept_orders_.drop_all();
  order_ = order;
  if (order.verb == CommandVerb::kCheck) return;  // nothing is reconstructed
  check_take_name(order.take);
  const TakePaths paths = take_paths(studio_, order.take);
  if (std::filesystem::exists(paths.mesh())) {
    throw InputError(paths.mesh().string() + " exists already; choose another take name");
  }
  std::error_code error;
  std::filesystem::create_directories(paths.folder, error);  // the mesh file tells what is wrong
  open(order, std::nullopt);
  persist_command(studio_, node_, order);
}

std::optional<CommandMessage> ReconNode::rejoin() {
  const auto found = kept_orders_.find_running(train_);
  if (!found) return std::nullopt;
  order_ = found->order;
  open(order_, found->commanded);
  train_.reset();
  events_.send(Severity::kWarning, "reconstruction",
               node_ + " was started anew and reconstructs " + order_.take + " again, from pulse " +
                   std::to_string(found->commanded) + " on",
               advice::kMeshesMissing);
  return order_;
}

void ReconNode::open(const CommandMessage& order, std::optional<int64_t> goes_on_at) {
  const StudioReconstruction& recon = studio_.reconstruction;
  const FrameSetOptions sets = sets_of(studio_, order);
  const int cameras = static_cast<int>(sets.cameras.size());
  const ReconstructOptions options{.bounds = studio_.space.bounds,
                                   .voxel_m = recon.voxel_m,
                                   .min_views = std::min(cameras, recon.min_views),
                                   .quality = recon.quality,
                                   .threads = recon.threads};
  const Rig rig = rig_of(sets.cameras, studio_.storage.calib);
  auto reconstructor = std::make_shared<Reconstructor>(rig, options);
  drift_ = std::make_unique<DisplacementMonitor>(rig, options);
  knocked_ = {};
  pipeline_ = std::make_unique<ReconPipeline>(
      ReconPipeline::Setup{
          .take = order.take,
          .mesh_file = take_paths(studio_, order.take).mesh(),
          .stages = stages_of(reconstructor),
          .threads = recon.threads,
          .sets = sets,
          .rehearsal = goes_on_at ? std::nullopt
                                  : std::optional(warm_up_frame_set(rig, studio_.space.bounds)),
          .done_with = [this](FrameSet& set) { drift_->offer(set); },
          .goes_on_at = goes_on_at,
          .shard = share_of(order, goes_on_at.has_value())},
      bus_);
}

std::optional<Shard::Setup> ReconNode::share_of(const CommandMessage& order,
                                                bool comes_later) const {
  const std::vector<std::string>& nodes = studio_.reconstruction.nodes;
  if (nodes.size() == 1) return std::nullopt;
  return Shard::Setup{.take = order.take,
                      .roster = nodes,
                      .me = node_,
                      .rate_hz = order.rate_hz > 0 ? order.rate_hz : studio_.trigger.rate_hz,
                      .comes_later = comes_later,
                      .frame_groups = bus_.frame_groups()};
}

void ReconNode::learn(const CommandMessage& order) {
  kept_orders_.drop_all();
  order_ = order;
}

void ReconNode::drain() { drain_began_ = Monotonic::now(); }

void ReconNode::disarm() {
  if (!pipeline_) return;
  pipeline_->close();
  last_ = pipeline_->counts();
  pipeline_.reset();
  end_drift_watch();
  // What the take's buffers leave free goes back to the system, or a day of takes touches more and
  // more of it. The rehearsal of the next take takes it again, before any pulse.
  malloc_trim(0);
  // A daemon that is told to end while pulses run may be back before they end.
  if (last_.meshes > 0 || stop_requested()) return;
  // A take that never saw a pulse leaves nothing behind; the folder goes with its last file.
  drop_command(studio_, node_, order_.take);
  remove_mesh_file_without_meshes(take_paths(studio_, order_.take));
}

/// Without waiting: it works in spare time, and there may be none.
void ReconNode::end_drift_watch() {
  drift_->end();
  leaving_.push_back(std::move(drift_));
}

std::optional<NodeReport> ReconNode::poll(Phase phase) {
  std::erase_if(leaving_, [](const auto& watch) { return watch->has_ended(); });
  switch (phase) {
    case Phase::kArming:
      return ready_report();
    case Phase::kLearning:
      return NodeReport{.event = Input::kReady, .text = "nothing to learn here", .detail = {}};
    case Phase::kRecording:
      return poll_recording();
    case Phase::kDraining:
      return poll_draining();
    default:
      return std::nullopt;
  }
}

NodeReport ReconNode::ready_report() const {
  if (order_.verb == CommandVerb::kBackground) {
    return {.event = Input::kReady, .text = "nothing to learn here", .detail = {}};
  }
  if (!pipeline_) return {.event = Input::kReady, .text = "looks on", .detail = {}};
  return {.event = Input::kReady,
          .text = "reconstructs at " + format_length(studio_.reconstruction.voxel_m),
          .detail = {}};
}

std::optional<NodeReport> ReconNode::poll_recording() {
  train_.poll(order_.take);
  if (!train_.ended()) return std::nullopt;
  return NodeReport{.event = Input::kTrainEnded, .text = "pulses have ended", .detail = {}};
}

std::optional<NodeReport> ReconNode::poll_draining() {
  if (!pipeline_) return NodeReport{.event = Input::kDrained, .text = "looked on", .detail = {}};
  const MonotonicInstant now = Monotonic::now();
  const bool waited = now - drain_began_ > kQuiet;
  if (!(waited && pipeline_->drained(kQuiet)) && now < drain_began_ + kDrainWithin) {
    return std::nullopt;
  }
  const bool closed = pipeline_->close();
  const ReconCounts counts = pipeline_->counts();
  if (!closed) {
    return NodeReport{.event = Input::kBroken,
                      .text = "cannot write " + take_paths(studio_, order_.take).mesh().string(),
                      .detail = detail_of(counts)};
  }
  return NodeReport{
      .event = Input::kDrained,
      .text = format_count(counts.meshes) + " meshes, " + format_count(counts.dropped) +
              " dropped, " + format_count(counts.failed) + " failed, " +
              format_count(counts.incomplete_sets) + " of incomplete sets" + share_text(counts),
      .detail = detail_of(counts)};
}

void ReconNode::report_health(HealthMessage& health) {
  const ReconCounts counts = pipeline_ ? pipeline_->counts() : last_;
  health.values.merge(values_of(counts));
  health.values["disk_free_bytes"] = disk_free_bytes(studio_);
  events_.keep_told(Severity::kAlarm, "disk",
                    counts.write_errors == 0 ? ""
                                             : format_count(counts.write_errors) +
                                                   " meshes refused: the disk is full or broken",
                    advice::kMeshDisk);
  report_drift(health);
  if (!counts.without_mesh.empty()) health.text = "no mesh of " + last_of(counts.without_mesh);
  const int64_t lost = counts.shard ? counts.shard->lost : 0;
  events_.keep_told(Severity::kWarning, "share",
                    lost == 0 ? "" : "pulses that no node made a mesh of", advice::kMeshesMissing);
  const bool behind = pipeline_ && counts.behind;
  events_.keep_told(Severity::kWarning, "reconstruction",
                    behind ? "cannot keep up: drops pulses, to show the newest" : "",
                    advice::kBehind);
  events_.keep_told(Severity::kWarning, "mesh",
                    counts.failed == 0 ? "" : "pulses without a mesh: " + counts.failure,
                    advice::kNoMesh);
  if (behind) health.text = "cannot keep up: " + format_count(counts.dropped) + " pulses dropped";
  if (counts.failed > 0) {
    health.text = format_count(counts.failed) + " pulses without a mesh: " + counts.failure;
  }
  if (counts.write_errors > 0) health.text = "meshes could not be written: the disk refuses";
}

/// The first word of a take about a camera stands, as long as it is not plainly another.
void ReconNode::report_drift(HealthMessage& health) {
  if (!drift_) return;
  for (const CameraDisplacement& camera : drift_->result()) {
    health.values[camera.camera + ".drift_px"] = camera.shift.norm();
    if (!camera.displaced) continue;
    health.text = camera.camera + " " + text_of(camera);
    const bool told =
        camera.camera == knocked_.camera && (camera.shift - knocked_.shift).norm() < kOtherShiftPx;
    if (told) continue;
    knocked_ = camera;
    events_.send(Severity::kAlarm, camera.camera, text_of(camera), advice::kCameraDisplaced);
  }
}

bool ReconNode::progressed_since(MonotonicInstant since) const {
  return !pipeline_ || pipeline_->progressed_since(since);
}

}  // namespace v3d
