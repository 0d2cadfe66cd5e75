#include "daemon_checks.h"

#include <algorithm>
#include <set>

#include "fault_sample.h"
#include "take/ledger/ledger.h"
#include "take/ledger/verify.h"
#include "take/logs/frame_log.h"
#include "take/logs/mesh_file.h"
#include "v3dctl/operate/reply_text.h"

namespace v3d::test {
namespace {

namespace fs = std::filesystem;
using Lost = std::vector<std::string>;

constexpr int kFirstSignal = 128;

class DaemonChecks {
 public:
  DaemonChecks(const InjectedStudio& studio, const DaemonRun& run, const Fault& fault)
      : studio_(studio), run_(run), fault_(fault), take_(studio.take()) {}

  Lost violations() {
    expect_orderly_end();
    expect_acknowledged();
    if (studio_.operation() != DaemonOperation::kReconstruct) {
      expect_ledgers();
      expect_no_complete_take_after_a_failed_sync();
      expect_whole_or_described();
    }
    if (must_succeed(fault_) && differs()) lost_.push_back("did not continue");
    if (!must_succeed(fault_) && differs() && !run_.program.reports(cause_of(fault_))) {
      lost_.emplace_back("no line with path and cause");
    }
    return lost_;
  }

 private:
  bool differs() const {
    return !run_.is_done || run_.ended_itself || run_.program.status != 0 || is_incomplete_;
  }

  void expect_orderly_end() {
    const int status = run_.program.status;
    if (status < 0) lost_.emplace_back("does not end after SIGTERM");
    if (status >= kFirstSignal) {
      lost_.push_back("killed by signal " + std::to_string(status - kFirstSignal));
    } else if (run_.was_ready && run_.ended_itself) {
      lost_.push_back("ended in the take with status " + std::to_string(status));
    }
  }

  /// Pulses of the frames in the log of a camera that can be read.
  std::set<int64_t> readable(const std::string& camera) {
    std::set<int64_t> pulses;
    if (!fs::exists(take_.frames(camera))) return pulses;
    try {
      take::FrameLogReader log(take_.frames(camera));
      for (const FrameLabel& label : log.labels()) {
        if (log.read(label.pulse)) pulses.insert(label.pulse);
      }
    } catch (const std::exception& error) {
      lost_.push_back("cannot read frames: " + std::string(error.what()));
    }
    return pulses;
  }

  int64_t readable_meshes() {
    if (!fs::exists(take_.mesh())) return 0;
    try {
      take::MeshFileReader meshes(take_.mesh());
      return std::ranges::count_if(meshes.pulses(), [&](int64_t pulse) {
        return io::value_or_throw(meshes.read(pulse)).has_value();
      });
    } catch (const std::exception& error) {
      lost_.push_back("cannot read meshes: " + std::string(error.what()));
      return 0;
    }
  }

  void expect_acknowledged() {
    const bool has_meshes = studio_.operation() == DaemonOperation::kReconstruct;
    const int64_t found = has_meshes ? readable_meshes() : std::ssize(readable("cam01"));
    if (has_meshes && run_.is_done && found < kInjectedPulses / 2) is_incomplete_ = true;
    if (found >= run_.acknowledged) return;
    lost_.push_back("reported as written: " + std::to_string(run_.acknowledged) +
                    ", readable: " + std::to_string(found));
  }

  /// Checks that each frame which the ledger does not list as missing can be read.
  void expect_ledger(const char* where, const take::Ledger& ledger) {
    for (const take::CameraLedger& camera : ledger.cameras) {
      const std::set<int64_t> frames = readable(camera.name);
      const std::set<int64_t> missing(camera.missing.begin(), camera.missing.end());
      // Frames of the restart are always missing.
      if (!missing.empty() && studio_.operation() == DaemonOperation::kRecord) {
        is_incomplete_ = true;
      }
      for (int64_t pulse = 0; pulse < ledger.commanded; ++pulse) {
        if (frames.contains(pulse) || missing.contains(pulse)) continue;
        lost_.push_back(std::string(where) + " does not list that " + camera.name +
                        " lacks pulse " + std::to_string(pulse));
      }
    }
  }

  void expect_ledgers() {
    expect_ledger("the reply", ctl::merge_ledgers(run_.stopped).ledger);
    if (!fs::exists(take_.ledger())) return;
    try {
      expect_ledger("ledger.toml", take::load_ledger(take_.ledger()));
    } catch (const std::exception& error) {
      lost_.emplace_back(error.what());
    }
  }

  bool is_failed_sync() const {
    const bool syncs = fault_.call == "fsync" || fault_.call == "syncfs";
    return syncs && !must_succeed(fault_) && run_.program.fired_on.ends_with(".lcmlog");
  }

  void expect_no_complete_take_after_a_failed_sync() {
    if (!is_failed_sync() || !fs::exists(take_.info())) return;
    if (!run_.program.reports(cause_of(fault_)))
      lost_.emplace_back("a failed sync is not reported");
    if (load_take_info(take_).state == take::TakeState::kComplete) {
      lost_.emplace_back("take.toml says complete, although a sync failed");
    }
  }

  /// After a recovery, files and ledger agree, or the run has reported the difference.
  void expect_whole_or_described() {
    if (!fs::exists(take_.info())) return;
    try {
      if (load_take_info(take_).state == take::TakeState::kRecording) {
        is_incomplete_ = true;
        recover_take(take_);
      }
      const take::Verification verified = verify_take(take_);
      if (!verified.disagreements.empty()) is_incomplete_ = true;
      const bool is_signed = fs::exists(take_.folder / ("signature." + studio_.node() + ".toml"));
      if (run_.is_done && !is_signed) is_incomplete_ = true;
    } catch (const std::exception& error) {
      lost_.push_back("cannot verify: " + std::string(error.what()));
    }
  }

  const InjectedStudio& studio_;
  const DaemonRun& run_;
  const Fault& fault_;
  const take::TakePaths take_;
  bool is_incomplete_ = false;
  Lost lost_;
};

}  // namespace

std::vector<std::string> violations_of(const InjectedStudio& studio, const DaemonRun& run,
                                       const Fault& fault) {
  return DaemonChecks(studio, run, fault).violations();
}

}  // namespace v3d::test
