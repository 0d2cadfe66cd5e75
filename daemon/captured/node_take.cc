#include "daemon/captured/node_take.h"

#include <spdlog/fmt/fmt.h>
#include <spdlog/spdlog.h>

#include <algorithm>

#include "base/core/error.h"
#include "base/io/file.h"
#include "daemon/node/persisted_command.h"
#include "daemon/node/take_folder.h"
#include "take/take_removal.h"

namespace v3d::captured {
namespace {

/// Queue length in frames that a short stall does not explain: live pulses are skipped.
constexpr int64_t kLiveBacklog = 5;

namespace fs = std::filesystem;

/// Paths of the log segments of a take, sorted.
io::Result<std::vector<fs::path>> logs_of(const take::TakePaths& paths) {
  return io::list_folder(paths.folder).map([](std::vector<fs::path> logs) {
    std::erase_if(logs, [](const fs::path& file) { return file.extension() != ".lcmlog"; });
    std::ranges::sort(logs);
    return logs;
  });
}

using Cameras = std::vector<NodeCameras::RecordedCamera>;

take::TakeInfo new_take(const NodeTake::Context& context, const NodeTake::Plan& plan,
                        const Cameras& cameras) {
  take::TakeInfo info{.name = plan.order.take,
                      .studio = context.studio.name,
                      .rate_hz = plan.disk.rate_hz,
                      .pulses = 0,
                      .state = take::TakeState::kRecording,
                      .software_version = V3D_VERSION,
                      .started = Realtime::now(),
                      .cameras = {}};
  for (const auto& camera : cameras) info.cameras.push_back(camera.worker->camera());
  return info;
}

}  // namespace

NodeTake::NodeTake(Context context, take::TakeInfo info, const DiskDemand& demand,
                   take::TakeLock lock)
    : context_(std::move(context)),
      info_(std::move(info)),
      paths_(node::take_paths(context_.studio, info_.name)),
      lock_(std::move(lock)),
      disk_(std::make_unique<TakeDisk>(paths_, demand)),
      admission_([&cameras = context_.cameras] { return cameras.max_queued(); }, kLiveBacklog) {}

std::unique_ptr<NodeTake> NodeTake::begin(const Context& context, const Plan& plan) {
  const take::TakePaths paths = node::take_paths(context.studio, plan.order.take);
  take::TakeLock lock = node::lock_take(paths, context.name);
  node::check_new_take(context.studio, plan.order.take);
  try {
    return create(context, plan, std::move(lock));
  } catch (...) {
    node::quarantine_unarmed_take(paths);
    throw;
  }
}

std::unique_ptr<NodeTake> NodeTake::create(const Context& context, const Plan& plan,
                                           take::TakeLock lock) {
  // A camera that is lost from now on is in the take, and its frames are missing.
  const Cameras cameras = context.cameras.recorded(plan.order.allow_missing);
  take::TakeInfo info = new_take(context, plan, cameras);
  node::create_take(context.studio, info);
  node::persist_command(context.studio, context.name, plan.order);
  std::unique_ptr<NodeTake> take(
      new NodeTake(context, std::move(info), plan.disk, std::move(lock)));
  for (const auto& camera : cameras) {
    take->add_pipeline(*camera.worker, segmentation::Segmenter(camera.background, {}));
  }
  // Nothing takes the frames of other cameras from their queues.
  for (const auto& worker : context.cameras) {
    const auto is_this = [&](const auto& camera) { return camera.worker == worker.get(); };
    if (std::ranges::none_of(cameras, is_this)) worker->disarm();
  }
  take->sync_names();
  take->begin_sound();
  return take;
}

std::unique_ptr<NodeTake> NodeTake::resume(const Context& context, const Plan& plan,
                                           TakeToResume resumed) {
  const take::TakePaths paths = node::take_paths(context.studio, plan.order.take);
  // Reserves the space for the ledger before anything is changed.
  std::unique_ptr<NodeTake> take(
      new NodeTake(context, load_take_info(paths), plan.disk, std::move(resumed.lock)));
  take->reopen(std::move(resumed.recorded));
  return take;
}

void NodeTake::reopen(RecordedTake recorded) {
  unread_ = std::move(recorded.problems);
  // After a failed sync the kernel can drop what it did not write, and the next sync succeeds. So
  // only another recovery, which reads the logs, can close the take.
  if (info_.state == take::TakeState::kRecording) {
    unread_.push_back("its recovery has failed; the next start of the daemon tries again");
  }
  earlier_sounds_ = earlier_sounds();
  resuming_.emplace(Resuming{.info = info_, .logs = io::value_or_throw(logs_of(paths_))});
  // Mark the take as open first: a crash after this line must be recovered with its new frames.
  info_ = node::reopen_take(paths_);
  add_resumed_pipelines(std::move(recorded));
  for (const std::string& problem : unread_) spdlog::error("{}", problem);
  resuming_->has_signature_aside = true;  // also when only the sync fails
  resuming_->has_signature_aside =
      io::value_or_throw(take::set_signature_aside(paths_, context_.name));
  sync_names();
}

void NodeTake::add_resumed_pipelines(RecordedTake recorded) {
  for (const auto& worker : context_.cameras) {
    const std::string& camera = worker->camera();
    const auto found = recorded.cameras.find(camera);
    if (found == recorded.cameras.end()) continue;
    ResumeState& resume = found->second;
    unread_.insert(unread_.end(), resume.problems.begin(), resume.problems.end());
    resuming_->cameras.emplace(worker.get(), resume.camera);
    add_pipeline(*worker, std::move(recorded.segmenters.at(camera)), std::move(resume));
  }
}

void NodeTake::rejoin(bool edges_are_reported) {
  begin_sound();
  const Resuming resuming = *std::exchange(resuming_, std::nullopt);
  for (const auto& [worker, past] : resuming.cameras) {
    worker->rejoin(period_of(info_.rate_hz), edges_are_reported, past);
  }
}

/// Without a recount, which would read the logs for minutes: the ledger of before is still that of
/// the take.
void NodeTake::undo_reopen() {
  pipelines_.clear();
  disk_.reset();
  const std::vector<fs::path>& before = resuming_->logs;
  for (const fs::path& log : logs_of(paths_).value_or(before)) {
    if (std::ranges::find(before, log) == before.end()) take::remove_empty_log(log);
  }
  const auto logs = logs_of(paths_);
  io::Status undone;
  if (logs && *logs == before && resuming_->has_signature_aside) {
    undone = take::restore_signature(paths_, context_.name);
  }
  if (logs && *logs == before && undone) undone = save_take_info(paths_, resuming_->info);
  if (logs && *logs == before && undone) return;
  spdlog::error("{} stays open; the next start of the daemon counts it{}", info_.name,
                undone ? "" : ": " + undone.error().message);
}

NodeTake::~NodeTake() {
  if (context_.sound != nullptr) context_.sound->end();
  if (resuming_) undo_reopen();
}

void NodeTake::begin_sound() {
  if (context_.sound != nullptr) context_.sound->begin(paths_, info_.name, info_.rate_hz);
}

/// Of the ledger: to map the files again would read all of them, and lose their xruns.
std::vector<take::SoundLedger> NodeTake::earlier_sounds() const {
  auto read = take::read_sounds(paths_);
  if (!read) return {};  // NodeSound reports it
  std::erase_if(read->sounds,
                [&](const take::SoundLedger& sound) { return sound.node != context_.name; });
  try {
    const take::Ledger ledger = take::load_ledger(paths_.ledger());
    for (take::SoundLedger& sound : read->sounds) {
      const auto listed = std::ranges::find(ledger.sounds, sound.file, &take::SoundLedger::file);
      if (listed != ledger.sounds.end()) sound = *listed;
    }
  } catch (const InputError& error) {  // of a recovery that has failed: another will count the take
    spdlog::warn("{}", error.what());
  }
  return read->sounds;
}

std::vector<take::SoundLedger> NodeTake::end_sound() {
  if (context_.sound == nullptr) return {};
  std::vector<take::SoundLedger> sounds = earlier_sounds_;
  if (auto ended = context_.sound->end()) sounds.push_back(*std::move(ended));
  return sounds;
}

void NodeTake::sync_names() const {
  if (auto synced = io::sync_folder(paths_.folder); !synced) io::throw_input_error(synced.error());
}

void NodeTake::add_pipeline(capture::CameraWorker& worker, segmentation::Segmenter segmenter,
                            std::optional<ResumeState> resume) {
  pipelines_.push_back(std::make_unique<CameraPipeline>(
      worker,
      CameraPipeline::Setup{.take = info_.name,
                            .log = paths_.frames(worker.camera()),
                            .segmenter = std::move(segmenter),
                            .rate_hz = info_.rate_hz,
                            .resume = std::move(resume),
                            .hashing = context_.signer != nullptr ? take::LogHashing::kTree
                                                                  : take::LogHashing::kChecksum},
      CameraPipeline::Shared{context_.bus, context_.slots, admission_}));
}

CameraPipelineCounts NodeTake::counts() const {
  CameraPipelineCounts sum;
  for (const auto& pipeline : pipelines_) {
    const CameraPipelineCounts counts = pipeline->counts();
    sum.received += counts.received;
    sum.written += counts.written;
    sum.write_errors += counts.write_errors;
    sum.published += counts.published;
  }
  return sum;
}

bool NodeTake::records(const std::string& camera) const {
  return std::ranges::any_of(pipelines_,
                             [&](const auto& pipeline) { return pipeline->camera() == camera; });
}

bool NodeTake::has_received(int64_t pulses, std::optional<MonotonicInstant> idle_since) const {
  return std::ranges::all_of(pipelines_, [&](const auto& pipeline) {
    return pipeline->counts().pulses >= pulses || (idle_since && pipeline->idle_since(*idle_since));
  });
}

bool NodeTake::progressed_since(MonotonicInstant since) const {
  return std::ranges::all_of(
      pipelines_, [&](const auto& pipeline) { return pipeline->progressed_since(since); });
}

/// In a take that is resumed, cameras are opened later than the take.
TakeDisk& NodeTake::disk() {
  disk_->expect(context_.cameras.bytes_per_pulse());
  return *disk_;
}

DiskErrors NodeTake::disk_errors() const {
  return {.dropped = context_.cameras.dropped(), .failed = counts().write_errors};
}

void NodeTake::stop_pipelines(take::Ledger& ledger) {
  ledger.take = info_.name;
  for (const auto& pipeline : pipelines_) {
    ledger.cameras.push_back(pipeline->close(ledger.commanded));
    ledger.files.push_back(pipeline->file());
  }
  ledger.sounds = end_sound();
  const bool lacks_sound = context_.sound != nullptr && ledger.sounds.empty();
  if (lacks_sound && ledger.commanded > 0) ledger.nodes_without_sound = {context_.name};
}

std::string NodeTake::unsynced(const io::Status& pulse_log) const {
  std::vector<std::string> cameras;
  std::vector<std::string> causes;
  for (const auto& pipeline : pipelines_) {
    if (pipeline->synced()) continue;
    cameras.push_back(pipeline->camera());
    causes.push_back(pipeline->synced().error().message);
  }
  if (!pulse_log) causes.push_back(pulse_log.error().message);
  if (causes.empty()) return "";
  const std::string what =
      cameras.empty() ? "pulses" : fmt::format("frames of {}", fmt::join(cameras, ", "));
  return "cannot write the last " + what + ": " + causes.front();
}

std::string NodeTake::open_reason(const io::Status& pulse_log) const {
  std::string reason = unsynced(pulse_log);
  if (reason.empty() && !unread_.empty()) {
    reason = "cannot count what it had before the restart: " + unread_.front();
  }
  return reason.empty() ? "" : info_.name + " stays open: " + reason;
}

TakeCloseReport NodeTake::close(const take::Ledger& ledger, bool is_empty,
                                const io::Status& pulse_log) {
  const std::string open_reason = this->open_reason(pulse_log);
  const take::TakeState state =
      open_reason.empty() ? take::TakeState::kComplete : take::TakeState::kRecording;
  disk_.reset();  // frees the space reserved for the ledger and the indexes
  for (const auto& pipeline : pipelines_) pipeline->save_index();
  pipelines_.clear();
  const auto closed = node::close_take(context_.studio, info_, ledger, state);
  if (!closed) {
    spdlog::error("{}", closed.error().message);
    return {.error = closed.error().message};
  }
  TakeCloseReport report{.error = open_reason, .checksum_error = checksum_error(*closed)};
  if (!report.error.empty()) return report;
  report.signing_error = sign(ledger.files);
  lock_.reset();  // before the folder may be moved
  if (!is_empty || may_hold_frames(paths_)) return report;
  const auto moved_to = quarantine_take(paths_);
  return {.quarantine_notice = info_.name + " has neither pulses nor frames" +
                               (moved_to ? ": moved to " + moved_to->string()
                                         : ", and " + moved_to.error().message)};
}

std::string NodeTake::checksum_error(const std::vector<std::string>& unread) const {
  for (const std::string& line : unread) {
    spdlog::error("take {}: its ledger lacks a checksum: {}", info_.name, line);
  }
  return unread.empty() ? ""
                        : "the ledger of " + info_.name + " lacks a checksum: " + unread.front();
}

std::string NodeTake::sign(const std::vector<take::TakeFile>& files) const {
  if (context_.signer == nullptr) return "";
  node::service::WorkProgress progress;  // sound of an hour is read for many seconds
  const io::Status done = sign_take(paths_, *context_.signer, files, [&] {
    progress.report();
    return true;
  });
  return done ? "" : "take " + info_.name + " is not signed: " + done.error().message;
}

}  // namespace v3d::captured
