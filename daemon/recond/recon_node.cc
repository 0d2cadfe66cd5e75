#include "daemon/recond/recon_node.h"

#include <malloc.h>

#include <algorithm>

#include "base/config/calib_file.h"
#include "base/core/error.h"
#include "base/core/text.h"
#include "base/io/file.h"
#include "daemon/control/reply_json.h"
#include "daemon/control/take_name.h"
#include "daemon/node/advice.h"
#include "daemon/node/service.h"
#include "daemon/node/take_folder.h"
#include "recon/pipeline/frame_set.h"
#include "take/ledger/ledger.h"
#include "take/take_removal.h"

namespace v3d::recond {
namespace {

/// The capture nodes drain at the same time. The last frames arrive within this time.
constexpr Duration kDrainIdle = std::chrono::milliseconds(1200);
constexpr Duration kDrainWithin = std::chrono::seconds(20);

/// Repaired pulses of a camera before the first event about it.
constexpr int64_t kMinRepairedPulses = 3;

/// A displacement that differs by this from the reported one is reported again.
constexpr double kNewDisplacementPx = 1;

std::map<std::string, double> values_of(const ShardCounts& c) {
  return {{"shard_pulses", static_cast<double>(c.made)},
          {"shard_taken_over", static_cast<double>(c.taken_over)},
          {"shard_repeated", static_cast<double>(c.repeated)},
          {"shard_duplicates", static_cast<double>(c.duplicates)},
          {"shard_let_go", static_cast<double>(c.released)},
          {"shard_given_up", static_cast<double>(c.given_up)},
          {"shard_lost", static_cast<double>(c.lost)},
          {"shard_nodes", static_cast<double>(c.alive)}};
}

/// "17-18", or the number of pulses and the last 24 of them.
std::string pulse_list(const std::vector<int64_t>& pulses) {
  constexpr ptrdiff_t kMaxListed = 24;
  if (std::ssize(pulses) <= kMaxListed) return take::number_ranges(pulses);
  return format_count(std::ssize(pulses)) + " pulses, the last " +
         take::number_ranges({pulses.end() - kMaxListed, pulses.end()});
}

/// The part of this node in a shared take, for the operator.
std::string share_text(const ReconCounts& counts) {
  if (!counts.shard) return "";
  const std::vector<int64_t>& without = counts.without_mesh;
  return ", " + format_count(counts.shard->made) + " made here, " +
         format_count(counts.shard->taken_over) + " taken over" +
         (without.empty() ? "" : "; no mesh of " + pulse_list(without));
}

std::map<std::string, double> values_of(const RepairCounts& c) {
  std::map<std::string, double> values = {
      {"repair_checked", static_cast<double>(c.checked)},
      {"repair_repaired", static_cast<double>(c.repaired)},
      {"repair_unchecked", static_cast<double>(c.unchecked)},
      {"repair_stopped", static_cast<double>(c.stopped)},
      {"repair_write_errors", static_cast<double>(c.write_errors)}};
  for (const auto& [camera, repairs] : c.cameras) {
    values[camera + ".repaired_pulses"] = static_cast<double>(repairs.pulses);
    values[camera + ".repaired_pixels"] = static_cast<double>(repairs.pixels);
    values[camera + ".repair_left_out"] = static_cast<double>(repairs.left_out);
  }
  return values;
}

/// The repaired pulses of a take, for the operator.
std::string repair_text(const ReconCounts& counts) {
  if (!counts.repair) return "";
  return ", silhouettes of " + format_count(counts.repair->repaired) + " of " +
         format_count(counts.repair->checked) + " checked pulses repaired";
}

/// The deformation of the live meshes, for the operator.
std::string passes_text(const ReconCounts& counts) {
  std::string text;
  for (size_t passes = counts.by_passes.size(); passes-- > 0;) {
    const int64_t meshes = counts.by_passes[passes];
    if (meshes == 0) continue;
    text += text.empty() ? ", deformed: " : ", ";
    text += format_count(meshes) + " by " + (passes == 0 ? "none" : std::to_string(passes)) +
            (passes == 1 ? " pass" : " passes");
  }
  return text;
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
      {"ghosts_removed", static_cast<double>(c.ghosts)},
      {"undecodable", static_cast<double>(c.undecodable)},
      {"implausible", static_cast<double>(c.implausible)},
      {"write_errors", static_cast<double>(c.write_errors)},
      {"latency_p50_ms", c.latency_p50_ms},
      {"latency_p99_ms", c.latency_p99_ms},
      {"live_fps", c.live_fps}};
  if (c.meshes > 0) {
    values["silhouette_iou_percent"] = 100 * c.quality.silhouette_iou;
    values["coverage_percent"] = 100 * c.quality.coverage;
  }
  if (c.shard) values.merge(values_of(*c.shard));
  if (c.repair) values.merge(values_of(*c.repair));
  if (c.performers) values["performers"] = static_cast<double>(*c.performers);
  for (size_t passes = 0; passes < c.by_passes.size(); ++passes) {
    values["meshes_of_" + std::to_string(passes) + "_passes"] =
        static_cast<double>(c.by_passes[passes]);
  }
  for (const auto& [camera, frames] : c.cameras) {
    values[camera + ".live_received"] = static_cast<double>(frames.received);
    values[camera + ".live_lost"] = static_cast<double>(frames.lost);
    values[camera + ".live_late"] = static_cast<double>(frames.late);
  }
  return values;
}

std::string detail_of(const ReconCounts& counts) {
  if (!counts.shard) return control::numbers_json(values_of(counts));
  return control::recon_json(values_of(counts), counts.without_mesh);
}

/// The cameras of this take: all but those that may be missing. Throws InputError without a camera.
recon::FrameSetOptions sets_of(const Studio& studio, const wire::CommandMessage& command) {
  recon::FrameSetOptions options;
  for (const StudioCamera& camera : studio.cameras) {
    const bool missing = std::find(command.allow_missing.begin(), command.allow_missing.end(),
                                   camera.name) != command.allow_missing.end();
    if (!missing) options.cameras.push_back(camera.name);
  }
  if (options.cameras.empty()) {
    throw InputError("all cameras may be missing; expected one at least that is required");
  }
  options.deadline = from_seconds(studio.reconstruction.deadline_ms * 1e-3);
  options.max_open = open_sets_of(options.deadline,
                                  command.rate_hz > 0 ? command.rate_hz : studio.trigger.rate_hz);
  return options;
}

/// The calibration of `cameras`, in this order, like `v3dctl reconstruct` reads it from the
/// take.
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

ReconNode::ReconNode(const Studio& studio, const std::string& node, bus::Bus& bus)
    : studio_(studio),
      node_(node),
      bus_(bus),
      events_(bus, node),
      train_(bus, studio.trigger.node),
      persisted_commands_(studio, node) {}

ReconNode::~ReconNode() { disarm(); }

void ReconNode::arm(const wire::CommandMessage& command) {
  persisted_commands_.drop_all();
  command_ = command;
  if (command.verb == wire::CommandVerb::kCheck) return;  // nothing is reconstructed
  control::check_take_name(command.take);
  const take::TakePaths paths = node::take_paths(studio_, command.take);
  // An earlier process that ended while the take was armed has left a file without meshes.
  if (file_exists(paths.mesh())) remove_mesh_file_without_meshes(paths);
  if (file_exists(paths.mesh())) {
    throw InputError(paths.mesh().string() + " exists already; choose another take name");
  }
  if (auto made = io::create_folders(paths.folder); !made) io::throw_input_error(made.error());
  open(command, std::nullopt);
  node::persist_command(studio_, node_, command);
}

std::optional<wire::CommandMessage> ReconNode::rejoin() {
  const auto found = persisted_commands_.find_running(train_);
  if (!found) return std::nullopt;
  command_ = found->command;
  open(command_, found->commanded);
  events_.send(wire::Severity::kWarning, "reconstruction",
               node_ + " restarted and reconstructs " + command_.take + " again from pulse " +
                   std::to_string(found->commanded) +
                   (studio_.reconstruction.performers ? ", with new numbers of performers" : ""),
               node::advice::kMeshesMissing);
  return command_;
}

void ReconNode::open(const wire::CommandMessage& command, std::optional<int64_t> resume_at) {
  const StudioReconstruction& recon = studio_.reconstruction;
  const recon::FrameSetOptions sets = sets_of(studio_, command);
  const int cameras = static_cast<int>(sets.cameras.size());
  const recon::ReconstructOptions options{.bounds = studio_.space.bounds,
                                          .voxel_m = recon.voxel_m,
                                          .min_views = std::min(cameras, recon.min_views),
                                          .quality = recon.quality,
                                          .threads = recon.threads};
  const Rig rig = rig_of(sets.cameras, studio_.storage.calib);
  auto reconstructor = std::make_shared<recon::Reconstructor>(rig, options);
  displacement_monitor_ = std::make_unique<DisplacementMonitor>(rig, options);
  reported_displacement_ = {};
  repair_events_.clear();
  pipeline_ = std::make_unique<ReconPipeline>(
      ReconPipeline::Setup{
          .take = command.take,
          .mesh_file = node::take_paths(studio_, command.take).mesh(),
          .stages = stages_of(reconstructor),
          .threads = recon.threads,
          .sets = sets,
          .warm_up = resume_at ? std::nullopt
                               : std::optional(recon::warm_up_frame_set(rig, studio_.space.bounds)),
          .repair = repair_setup(rig, options),
          .live_passes = recon.quality == Quality::kMedium ? options.live_passes : 0,
          .performers = recon.performers,
          .on_set_begins = [this] { displacement_monitor_->begin_set(); },
          .on_set_ends = [this] { displacement_monitor_->end_set(); },
          .on_finished_set = [this](recon::FrameSet& set) { displacement_monitor_->offer(set); },
          .resume_at = resume_at,
          .shard = shard_setup(command, resume_at.has_value())},
      bus_);
}

std::optional<LiveRepair::Setup> ReconNode::repair_setup(
    const Rig& rig, const recon::ReconstructOptions& options) const {
  if (!studio_.reconstruction.repair) return std::nullopt;
  std::vector<std::string> cameras;
  for (const RigCamera& camera : rig) cameras.push_back(camera.name);
  auto repair = std::make_shared<recon::FrameSetRepair>(rig, options);
  return LiveRepair::Setup{
      .cameras = cameras,
      .list = take::repaired_pulses_path(node::take_paths(studio_, command_.take), node_),
      .repair = [repair](recon::FrameSet& set, const recon::StopRequest& should_stop) {
        return repair->repair(set, should_stop);
      }};
}

std::optional<Shard::Setup> ReconNode::shard_setup(const wire::CommandMessage& command,
                                                   bool joins_late) const {
  const std::vector<std::string>& nodes = studio_.reconstruction.nodes;
  if (nodes.size() == 1) return std::nullopt;
  return Shard::Setup{.take = command.take,
                      .roster = nodes,
                      .node = node_,
                      .rate_hz = command.rate_hz > 0 ? command.rate_hz : studio_.trigger.rate_hz,
                      .joins_late = joins_late,
                      .frame_groups = bus_.frame_groups(),
                      .deadline = from_seconds(studio_.reconstruction.deadline_ms * 1e-3)};
}

void ReconNode::learn(const wire::CommandMessage& command) {
  persisted_commands_.drop_all();
  command_ = command;
}

void ReconNode::drain() { drain_began_ = Monotonic::now(); }

void ReconNode::disarm() {
  if (!pipeline_) return;
  if (const io::Status closed = pipeline_->close(); !closed) {
    events_.send(wire::Severity::kAlarm, "disk", closed.error().message, node::advice::kMeshDisk);
  }
  last_ = pipeline_->counts();
  pipeline_.reset();
  stop_displacement_monitor();
  // Return the memory of the take's buffers to the system; otherwise the process grows over a day
  // of takes. The warm-up of the next take allocates it again, before any pulse.
  malloc_trim(0);
  // A daemon that is stopped while pulses run may be restarted before they end.
  if (last_.meshes > 0 || node::stop_requested()) return;
  // Remove the files of a take without pulses. The folder is removed with its last file.
  node::drop_command(studio_, node_, command_.take);
  remove_mesh_file_without_meshes(node::take_paths(studio_, command_.take));
}

/// Does not wait for the monitor, which may get no processor time for long.
void ReconNode::stop_displacement_monitor() {
  displacement_monitor_->stop();
  stopping_monitors_.push_back(std::move(displacement_monitor_));
}

std::optional<control::NodeReport> ReconNode::poll(control::Phase phase) {
  std::erase_if(stopping_monitors_, [](const auto& monitor) { return monitor->has_stopped(); });
  switch (phase) {
    case control::Phase::kArming:
      return ready_report();
    case control::Phase::kLearning:
      return control::NodeReport{
          .event = control::Input::kReady, .text = "nothing to learn here", .detail = {}};
    case control::Phase::kRecording:
      return poll_recording();
    case control::Phase::kDraining:
      return poll_draining();
    default:
      return std::nullopt;
  }
}

control::NodeReport ReconNode::ready_report() const {
  if (command_.verb == wire::CommandVerb::kBackground) {
    return {.event = control::Input::kReady, .text = "nothing to learn here", .detail = {}};
  }
  if (!pipeline_)
    return {.event = control::Input::kReady, .text = "nothing to reconstruct", .detail = {}};
  return {.event = control::Input::kReady,
          .text = "reconstructs at " + format_length(studio_.reconstruction.voxel_m),
          .detail = {}};
}

std::optional<control::NodeReport> ReconNode::poll_recording() {
  train_.poll(command_.take);
  if (!train_.ended()) return std::nullopt;
  return control::NodeReport{
      .event = control::Input::kTrainEnded, .text = "pulses have ended", .detail = {}};
}

std::optional<control::NodeReport> ReconNode::poll_draining() {
  if (!pipeline_) {
    return control::NodeReport{
        .event = control::Input::kDrained, .text = "nothing to reconstruct", .detail = {}};
  }
  train_.poll(command_.take);
  if (train_.commanded() > 0) pipeline_->on_last_pulse(train_.commanded() - 1);
  const MonotonicInstant now = Monotonic::now();
  const bool waited = now - drain_began_ > kDrainIdle;
  if (!(waited && pipeline_->drained(kDrainIdle)) && now < drain_began_ + kDrainWithin) {
    return std::nullopt;
  }
  const io::Status closed = pipeline_->close();
  const ReconCounts counts = pipeline_->counts();
  if (!closed) {
    return control::NodeReport{.event = control::Input::kBroken,
                               .text = closed.error().message,
                               .detail = detail_of(counts)};
  }
  return control::NodeReport{.event = control::Input::kDrained,
                             .text = format_count(counts.meshes) + " meshes, " +
                                     format_count(counts.dropped) + " dropped, " +
                                     format_count(counts.failed) + " failed, " +
                                     format_count(counts.incomplete_sets) + " of incomplete sets" +
                                     share_text(counts) + passes_text(counts) + repair_text(counts),
                             .detail = detail_of(counts)};
}

void ReconNode::report_health(wire::HealthMessage& health) {
  const ReconCounts counts = pipeline_ ? pipeline_->counts() : last_;
  health.values.merge(values_of(counts));
  node::report_free_space(node::disk_free_bytes(studio_), health);
  events_.report_condition(wire::Severity::kAlarm, "disk",
                           counts.write_errors == 0
                               ? ""
                               : format_count(counts.write_errors) +
                                     " meshes could not be written: the disk is full or broken",
                           node::advice::kMeshDisk);
  report_displacement(health);
  report_repairs(counts);
  if (!counts.without_mesh.empty()) health.text = "no mesh of " + pulse_list(counts.without_mesh);
  const int64_t lost = counts.shard ? counts.shard->lost : 0;
  events_.report_condition(wire::Severity::kWarning, "share",
                           lost == 0 ? "" : "pulses that no node made a mesh of",
                           node::advice::kMeshesMissing);
  events_.report_condition(wire::Severity::kAlarm, "network", counts.join_failure,
                           node::advice::kFrameGroup);
  if (!counts.join_failure.empty()) health.text = counts.join_failure;
  const bool behind = pipeline_ && counts.behind;
  events_.report_condition(wire::Severity::kWarning, "reconstruction",
                           behind ? "cannot keep up: drops pulses to show the newest" : "",
                           node::advice::kBehind);
  events_.report_condition(wire::Severity::kWarning, "mesh",
                           counts.failed == 0 ? "" : "pulses without a mesh: " + counts.failure,
                           node::advice::kNoMesh);
  if (behind) health.text = "cannot keep up: " + format_count(counts.dropped) + " pulses dropped";
  if (counts.failed > 0) {
    health.text = format_count(counts.failed) + " pulses without a mesh: " + counts.failure;
  }
  if (counts.write_errors > 0) {
    health.text = "meshes could not be written: the disk is full or broken";
  }
}

/// Sends an event for the first displaced camera of a take, and again only when it differs clearly.
void ReconNode::report_displacement(wire::HealthMessage& health) {
  if (!displacement_monitor_) return;
  for (const recon::CameraDisplacement& camera : displacement_monitor_->result()) {
    health.values[camera.camera + ".drift_px"] = camera.shift.norm();
    if (!camera.displaced) continue;
    health.text = camera.camera + " " + text_of(camera);
    const bool is_reported =
        camera.camera == reported_displacement_.camera &&
        (camera.shift - reported_displacement_.shift).norm() < kNewDisplacementPx;
    if (is_reported) continue;
    reported_displacement_ = camera;
    events_.send(wire::Severity::kAlarm, camera.camera, text_of(camera),
                 node::advice::kCameraDisplaced);
  }
}

/// Sends an event for each camera with silhouettes that were repaired again and again;
/// EventThrottle limits the events of a camera. One pulse alone may be a false alarm.
void ReconNode::report_repairs(const ReconCounts& counts) {
  if (!pipeline_ || !counts.repair) return;
  for (const auto& [camera, repairs] : counts.repair->cameras) {
    if (repairs.pulses < kMinRepairedPulses) continue;
    if (!repair_events_[camera].is_report_due(repairs.pulses, Monotonic::now())) continue;
    events_.send(wire::Severity::kWarning, camera,
                 "silhouette repaired in " + format_count(repairs.pulses) + " of " +
                     format_count(counts.repair->checked) + " checked pulses, last in pulse " +
                     format_count(repairs.last_pulse) + ": " + text_of_last_fault(repairs),
                 node::advice::kSilhouette);
  }
}

bool ReconNode::progressed_since(MonotonicInstant since) const {
  return !pipeline_ || pipeline_->progressed_since(since);
}

}  // namespace v3d::recond
