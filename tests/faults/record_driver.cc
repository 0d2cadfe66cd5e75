// Program that records a take with the classes of v3d-captured, in the order of CaptureNode. It
// writes to MARKS which data these classes reported as safe:
//   record_driver record FOLDER MARKS      a whole take
//   record_driver cut FOLDER MARKS         the same, with _exit() before the take is closed
//   record_driver restart FOLDER MARKS     recovers open takes, continues the take and closes it
//   record_driver recover FOLDER MARKS     recovers open takes
//   record_driver quarantine FOLDER MARKS  a take without pulses
//   record_driver serial FOLDER MARKS      saves the serial number of an accepted member list
//   record_driver record_large FOLDER MARKS  like record, with frames of 192 pages
//   record_driver mesh FOLDER MARKS        writes a mesh.v3d, with _exit() before it is closed
//   record_driver mesh_restart FOLDER MARKS  continues that mesh.v3d and closes it
// It does not sync logs while it records: the classes do.
// Marks, one line each: "ready", "frame CAMERA PULSE", "synced" (all frames before it),
// "recovered", "complete" (and signed), "quarantined PATH", "serial", "mesh mesh PULSE", "closed".
// Exit status: 0 done, 3 done but data is missing, 2 InputError, 1 any other error. Every error is
// a line on stderr.
#include <dlfcn.h>
#include <fcntl.h>
#include <spdlog/sinks/stdout_sinks.h>
#include <spdlog/spdlog.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <condition_variable>
#include <cstdio>
#include <map>
#include <memory>
#include <mutex>

#include "base/core/error.h"
#include "base/io/file.h"
#include "daemon/bus/credential_files.h"
#include "daemon/captured/pulse_recorder.h"
#include "daemon/captured/take_disk.h"
#include "daemon/captured/take_rejoin.h"
#include "daemon/node/persisted_command.h"
#include "daemon/node/take_folder.h"
#include "recorded_take.h"
#include "take/ledger/take_signature.h"
#include "take/logs/frame_log.h"
#include "take/logs/mesh_file.h"
#include "take/take_removal.h"

namespace v3d::test {
namespace {

constexpr captured::DiskDemand kDemand{
    .rate_hz = 25, .bytes_per_pulse = 2 * 64 * 48, .pulses = 12, .queue_frames = 8};

/// A short period instead of a second, because the tests run this program hundreds of times.
constexpr Duration kSyncPeriod = std::chrono::milliseconds(50);

enum class Synced { kDone, kFailed, kLate };

/// The finished syncs of all files of this process. Thread-safe.
class SyncedFiles {
 public:
  static SyncedFiles& of_process() {
    static SyncedFiles files;
    return files;
  }

  /// `bytes`: length of the file when the sync began.
  void add(const std::filesystem::path& path, int64_t bytes, bool has_failed) {
    const std::lock_guard lock(mutex_);
    File& file = files_[path];
    file.has_failed = file.has_failed || has_failed;
    if (!has_failed) file.bytes = std::max(file.bytes, bytes);
    changed_.notify_all();
  }

  /// Waits until the first `bytes` bytes of the file are synced, at most ten seconds.
  Synced wait_for(const std::filesystem::path& path, int64_t bytes) {
    std::unique_lock lock(mutex_);
    const File& file = files_[path];
    const bool is_over = changed_.wait_for(lock, std::chrono::seconds(10),
                                           [&] { return file.has_failed || file.bytes >= bytes; });
    if (file.has_failed) return Synced::kFailed;
    return is_over ? Synced::kDone : Synced::kLate;
  }

 private:
  struct File {
    int64_t bytes = 0;
    bool has_failed = false;
  };
  std::mutex mutex_;
  std::condition_variable changed_;
  std::map<std::filesystem::path, File> files_;
};

class Driver {
 public:
  Driver(const std::filesystem::path& folder, const char* marks, ImageSize size)
      : size_(size),
        studio_(driven_studio(folder)),
        paths_(node::take_paths(studio_, kDrivenTake)),
        marks_(::open(marks, O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0644)) {
    info_ = {.name = kDrivenTake,
             .studio = studio_.name,
             .rate_hz = kDemand.rate_hz,
             .pulses = 0,
             .state = take::TakeState::kRecording,
             .software_version = "0.1.0",
             .started = {},
             .cameras = kDrivenCameras};
  }

  void begin() {
    check_disk(studio_.storage.takes, kDemand);
    lock_.emplace(node::lock_take(paths_, kDrivenNode));
    node::create_take(studio_, info_);
    wire::CommandMessage order;
    order.take = kDrivenTake;
    node::persist_command(studio_, kDrivenNode, order);
    disk_ = std::make_unique<captured::TakeDisk>(paths_, kDemand);
    open_logs(take::LogOpening::kNew);
    mark("ready");
  }

  void recover() {
    for (const node::RecoveredTake& take :
         node::recover_open_takes(studio_, kDrivenNode, kDrivenCameras)) {
      if (!take.ledger) status_ = 3;
      std::fprintf(stderr, "record_driver: %s\n", take.line.c_str());
      if (take.ledger) mark("recovered");
    }
  }

  void continue_take() {
    recover();
    std::vector<std::string> problems;
    const captured::EdgeTimes edges = captured::read_edge_times(paths_, problems);
    lock_.emplace(node::lock_take(paths_, kDrivenNode));
    info_ = node::reopen_take(paths_);
    first_pulse_ = kDrivenPulses;
    for (const auto& [pulse, edge] : edges) sensed_.insert(pulse);
    disk_ = std::make_unique<captured::TakeDisk>(paths_, kDemand);
    for (size_t c = 0; c < kDrivenCameras.size(); ++c) {
      const captured::ResumeState state =
          captured::read_resume_state(paths_, kDrivenCameras[c], edges);
      accounts_[c] = state.account;
      problems.insert(problems.end(), state.problems.begin(), state.problems.end());
    }
    for (const std::string& problem : problems) fail(problem);
    open_logs(take::LogOpening::kContinue);
    mark("ready");
  }

  void record() {
    for (int64_t n = 0; n < kDrivenPulses; ++n) {
      const int64_t pulse = first_pulse_ + n;
      wire::PulseMessage sensed;
      sensed.pulse = pulse;
      pulses_->write(sensed);
      sensed_.insert(pulse);
      for (size_t c = 0; c < logs_.size(); ++c) record_frame(c, pulse);
      if (n == kDrivenPulses / 2) wait_for_sync();
    }
  }

  void close() {
    end_logs();
    std::vector<take::TakeFile> files;
    for (const take::EventLogWriter& log : logs_) files.push_back(log.file());
    pulses_->close();
    const int64_t lost = pulses_->lost();
    const bool is_synced = pulses_->synced().has_value();
    pulses_.reset();
    if (lost > 0 || !is_synced) {
      fail(paths_.pulses().string() + ": " + std::to_string(lost) + " pulses lost" +
           (is_synced ? "" : ", and the others are not synced"));
    }
    disk_.reset();
    for (const take::EventLogWriter& log : logs_) {
      if (const io::Status saved = log.save_index(); !saved) fail(saved.error().message);
    }
    logs_.clear();
    take::Ledger ledger = account();
    ledger.files = std::move(files);
    const auto closed = node::close_take(studio_, info_, ledger);
    if (!closed) return fail(closed.error().message);
    if (!closed->empty()) return fail(closed->front());
    const io::Status signed_now =
        sign_take(paths_, {kDrivenNode, wire::SigningKey::make()}, ledger.files);
    if (!signed_now) fail(signed_now.error().message);
    lock_.reset();
    if (!ledger.complete()) return fail(paths_.folder.string() + ": " + ledger.verdict());
    if (status_ == 0) mark("complete");
  }

  void quarantine() {
    logs_.clear();
    pulses_.reset();
    disk_.reset();
    if (!node::close_take(studio_, info_,
                          take::Ledger{.take = kDrivenTake, .sensed = {}, .cameras = {}})) {
      return fail("cannot close " + paths_.folder.string());
    }
    lock_.reset();
    if (may_hold_frames(paths_)) return;  // such a take is not moved
    const auto place = quarantine_take(paths_);
    if (!place) return fail(place.error().message);
    mark("quarantined " + place->string());
  }

  void save_serial() {
    const bus::AcceptedSerial serial(member_serial_file(studio_), studio_.name, "authority");
    if (auto saved = serial.save(kDrivenSerial); !saved) return fail(saved.error().message);
    mark("serial");
  }

  /// Appends kDrivenMeshes meshes.
  void write_meshes(take::LogOpening opening) {
    if (auto made = io::create_folders(paths_.folder); !made) io::throw_input_error(made.error());
    take::MeshFileWriter file(paths_.mesh(), opening);
    mark("ready");
    const int64_t first = file.last_pulse().value_or(-1) + 1;
    for (int64_t pulse = first; pulse < first + kDrivenMeshes; ++pulse) {
      if (auto written = file.append(pulse, driven_mesh(pulse)); !written) {
        fail(written.error().message);
      } else {
        mark("mesh mesh " + std::to_string(pulse));
      }
      if (pulse == first + kDrivenMeshes / 2) wait_for_sync_of(paths_.mesh());
    }
    if (opening == take::LogOpening::kNew) _exit(status_);
    if (auto closed = file.close(); !closed) return fail(closed.error().message);
    mark("synced");
    mark("closed");
  }

  /// Writes all queued pulses. A daemon that crashes loses the pulses in this queue; this driver
  /// must not.
  void wait_for_pulses() { pulses_->close(); }

  int status() const { return status_; }

 private:
  void open_logs(take::LogOpening opening) {
    for (const std::string& camera : kDrivenCameras) {
      logs_.emplace_back(paths_.frames(camera), opening, take::LogHashing::kTree, kSyncPeriod);
    }
    if (auto synced = io::sync_folder(paths_.folder); !synced) {
      io::throw_input_error(synced.error());
    }
    pulses_ = std::make_unique<captured::PulseLog>(paths_.pulses(), opening, kSyncPeriod);
  }

  void record_frame(size_t camera, int64_t pulse) {
    const auto message = recorded_frame(kDrivenCameras[camera], pulse, size_);
    if (auto written = logs_[camera].write(message); !written) return fail(written.error().message);
    accounts_[camera].add(pulse, false);
    mark("frame " + kDrivenCameras[camera] + " " + std::to_string(pulse));
  }

  /// Waits until the logs have synced all frames by themselves, or a sync has failed.
  void wait_for_sync() {
    bool is_synced = true;
    for (const take::EventLogWriter& log : logs_) {
      const auto synced = SyncedFiles::of_process().wait_for(log.path(), log.bytes());
      if (synced == Synced::kLate) fail(log.path().string() + ": is not synced within 10 s");
      is_synced = is_synced && synced == Synced::kDone;
    }
    if (is_synced) mark("synced");
  }

  /// Waits until a file has synced its present content by itself.
  void wait_for_sync_of(const std::filesystem::path& file) {
    const auto bytes = static_cast<int64_t>(std::filesystem::file_size(file));
    const auto synced = SyncedFiles::of_process().wait_for(file, bytes);
    if (synced == Synced::kDone) return mark("synced");
    fail(file.string() + ": is not synced within 10 s");
  }

  void end_logs() {
    bool is_synced = true;
    for (take::EventLogWriter& log : logs_) {
      const auto synced = log.end();
      if (!synced) fail(synced.error().message);
      is_synced = is_synced && synced.has_value();
    }
    if (is_synced) mark("synced");
  }

  take::Ledger account() const {
    take::Ledger ledger{.take = kDrivenTake, .sensed = {}, .cameras = {}};
    ledger.commanded = first_pulse_ + kDrivenPulses;
    ledger.sensed = sensed_.size();
    ledger.unsensed = sensed_.missing(ledger.commanded);
    for (size_t c = 0; c < kDrivenCameras.size(); ++c) {
      ledger.cameras.push_back(accounts_[c].ledger(kDrivenCameras[c], ledger.commanded));
    }
    return ledger;
  }

  void mark(const std::string& text) const {
    const std::string line = text + "\n";
    if (write(marks_, line.data(), line.size()) != static_cast<ssize_t>(line.size())) _exit(1);
  }

  void fail(const std::string& what) {
    std::fprintf(stderr, "record_driver: %s\n", what.c_str());
    status_ = 3;
  }

  const ImageSize size_;
  const Studio studio_;
  const take::TakePaths paths_;
  const int marks_;
  take::TakeInfo info_;
  int64_t first_pulse_ = 0;
  std::optional<take::TakeLock> lock_;
  std::unique_ptr<captured::TakeDisk> disk_;
  std::vector<take::EventLogWriter> logs_;
  std::array<take::CameraAccount, 2> accounts_;
  take::PulseSet sensed_;
  std::unique_ptr<captured::PulseLog> pulses_;
  int status_ = 0;
};

int run(const std::string& operation, const std::filesystem::path& folder, const char* marks) {
  Driver driver(folder, marks, operation == "record_large" ? kLargeSize : kDrivenSize);
  if (operation == "recover") {
    driver.recover();
    return driver.status();
  }
  if (operation == "serial") {
    driver.save_serial();
    return driver.status();
  }
  if (operation.starts_with("mesh")) {
    driver.write_meshes(operation == "mesh" ? take::LogOpening::kNew : take::LogOpening::kContinue);
    return driver.status();
  }
  operation == "restart" ? driver.continue_take() : driver.begin();
  if (operation == "quarantine") {
    driver.quarantine();
    return driver.status();
  }
  driver.record();
  if (operation == "cut") {
    driver.wait_for_pulses();
    _exit(driver.status());
  }
  driver.close();
  return driver.status();
}

}  // namespace
}  // namespace v3d::test

/// Replaces fsync() of the C library in this program. Files are written by position, so that the
/// file offset is free to find the length.
extern "C" int fsync(int fd) {
  static auto* const next = reinterpret_cast<int (*)(int)>(dlsym(RTLD_NEXT, "fsync"));
  std::error_code error;
  const auto path = std::filesystem::read_symlink("/proc/self/fd/" + std::to_string(fd), error);
  const int64_t bytes = syscall(SYS_lseek, fd, 0, SEEK_END);  // never injected
  const int failed = next(fd);
  const int cause = errno;
  v3d::test::SyncedFiles::of_process().add(path, bytes, failed != 0 && cause != EINTR);
  errno = cause;
  return failed;
}

int main(int argc, char** argv) {
  if (argc != 4) return 2;
  spdlog::set_default_logger(spdlog::stderr_logger_mt("record_driver"));
  try {
    return v3d::test::run(argv[1], argv[2], argv[3]);
  } catch (const v3d::InputError& error) {
    std::fprintf(stderr, "record_driver: %s\n", error.what());
    return 2;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "record_driver: %s\n", error.what());
    return 1;
  }
}
