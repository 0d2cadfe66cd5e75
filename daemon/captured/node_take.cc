#include "daemon/captured/node_take.h"

#include <spdlog/fmt/fmt.h>

#include <algorithm>

#include "base/io/file.h"
#include "daemon/node/persisted_command.h"
#include "daemon/node/take_folder.h"
#include "take/take_removal.h"

namespace v3d {
namespace {

/// More frames behind one camera than a hiccup explains: the live picture waits.
constexpr int64_t kLiveBacklog = 5;

TakeInfo new_take(const NodeTake::Node& node, const NodeTake::Plan& plan) {
  TakeInfo info{.name = plan.order.take,
                .studio = node.studio.name,
                .rate_hz = plan.disk.rate_hz,
                .pulses = 0,
                .state = TakeState::kRecording,
                .software_version = V3D_VERSION,
                .started = Realtime::now(),
                .cameras = {}};
  for (const CameraWorker* worker : node.cameras.ready()) info.cameras.push_back(worker->camera());
  return info;
}

}  // namespace

NodeTake::NodeTake(Node node, TakeInfo info, const DiskDemand& demand, TakeLock lock)
    : node_(node),
      info_(std::move(info)),
      paths_(take_paths(node.studio, info_.name)),
      lock_(std::move(lock)),
      disk_(std::make_unique<TakeDisk>(paths_, demand)),
      gate_([&cameras = node.cameras] { return cameras.most_waiting(); }, kLiveBacklog) {}

std::unique_ptr<NodeTake> NodeTake::begin(Node node, const Plan& plan) {
  TakeInfo info = new_take(node, plan);
  TakeLock lock = lock_take(take_paths(node.studio, info.name), node.name);
  create_take(node.studio, info);
  persist_command(node.studio, node.name, plan.order);
  std::unique_ptr<NodeTake> take(new NodeTake(node, std::move(info), plan.disk, std::move(lock)));
  for (CameraWorker* worker : node.cameras.ready()) {
    take->add_lane(*worker, node.cameras.background_of(*worker));
  }
  take->sync_names();
  return take;
}

std::unique_ptr<NodeTake> NodeTake::go_on(Node node, const Plan& plan, const EdgeTimes& pulses,
                                          bool edges_are_told) {
  const TakePaths paths = take_paths(node.studio, plan.order.take);
  TakeLock lock = lock_take(paths, node.name);
  // First: a crash in what follows must find an open take, and recover what is recorded meanwhile.
  TakeInfo info = reopen_take(paths);
  std::unique_ptr<NodeTake> take(new NodeTake(node, std::move(info), plan.disk, std::move(lock)));
  for (const auto& worker : node.cameras) {
    const std::string& camera = worker->camera();
    if (std::ranges::find(take->info_.cameras, camera) == take->info_.cameras.end()) continue;
    ResumeState past = read_resume_state(take->paths_, camera, pulses);
    worker->rejoin(period_of(take->info_.rate_hz), edges_are_told, past.camera);
    take->add_lane(*worker, load_background(take->paths_.background(), camera), std::move(past));
  }
  take->sync_names();
  return take;
}

void NodeTake::sync_names() const {
  if (auto synced = io::sync_folder(paths_.folder); !synced) io::throw_input_error(synced.error());
}

void NodeTake::add_lane(CameraWorker& worker, const BackgroundModel& background,
                        std::optional<ResumeState> past) {
  lanes_.push_back(std::make_unique<CameraPipeline>(
      worker,
      CameraPipeline::Setup{
          .take = info_.name,
          .log = paths_.frames(worker.camera()),
          .segmenter = Segmenter(background, {}),
          .rate_hz = info_.rate_hz,
          .past = std::move(past),
          .hashing = node_.signer != nullptr ? LogHashing::kTree : LogHashing::kChecksum},
      CameraPipeline::Shared{node_.bus, node_.places, gate_}));
}

CameraPipelineCounts NodeTake::counts() const {
  CameraPipelineCounts sum;
  for (const auto& lane : lanes_) {
    const CameraPipelineCounts counts = lane->counts();
    sum.received += counts.received;
    sum.written += counts.written;
    sum.write_errors += counts.write_errors;
    sum.published += counts.published;
  }
  return sum;
}

bool NodeTake::has_all(int64_t pulses, std::optional<MonotonicInstant> quiet_since) const {
  return std::ranges::all_of(lanes_, [&](const auto& lane) {
    return lane->counts().received >= pulses || (quiet_since && lane->quiet_since(*quiet_since));
  });
}

bool NodeTake::progressed_since(MonotonicInstant since) const {
  return std::ranges::all_of(lanes_,
                             [&](const auto& lane) { return lane->progressed_since(since); });
}

DiskProgress NodeTake::progress() const {
  return {.dropped = node_.cameras.dropped(), .refused = counts().write_errors};
}

void NodeTake::end(Ledger& ledger) {
  ledger.take = info_.name;
  for (const auto& lane : lanes_) {
    ledger.cameras.push_back(lane->close(ledger.commanded));
    ledger.files.push_back(lane->file());
  }
}

TakeClosing NodeTake::close(const Ledger& ledger, bool is_empty) {
  std::vector<std::string> unkept;
  for (const auto& lane : lanes_) {
    if (!lane->is_kept()) unkept.push_back(lane->camera());
  }
  lanes_.clear();
  disk_.reset();  // its room is the ledger's
  const std::string takes = node_.studio.storage.takes.string();
  if (!close_take(node_.studio, info_, ledger)) {
    return {.unkept = "cannot write the ledger of " + info_.name + " completely to " + takes};
  }
  TakeClosing closing{.unsigned_why = sign(ledger.files)};
  lock_.reset();  // before the folder may be moved
  if (!unkept.empty()) {
    closing.unkept = takes + " did not keep the last frames of " +
                     fmt::format("{}", fmt::join(unkept, ", ")) + ": v3dctl verify tells which";
    return closing;
  }
  if (!is_empty || may_hold_frames(paths_)) return closing;
  const auto place = quarantine_take(paths_);
  return {.notice = info_.name + " has neither pulses nor frames" +
                    (place ? ": moved to " + place->string() : ", and " + place.error().message)};
}

std::string NodeTake::sign(const std::vector<TakeFile>& files) const {
  if (node_.signer == nullptr) return "";
  const io::Status done = sign_take(paths_, *node_.signer, files);
  return done ? "" : "take " + info_.name + " is not signed: " + done.error().message;
}

}  // namespace v3d
