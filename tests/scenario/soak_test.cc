// Soak test for leaks: fifteen cameras at 25 Hz with a fault every three seconds.
// In the first half, takes of twelve seconds follow each other; they show what leaks in each take
// (threads, descriptors, buffers). The second half is one take, which shows what leaks in each
// pulse.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cstdlib>
#include <map>
#include <set>

#include "sim/cameras/exposure_record.h"
#include "studio4.h"
#include "support/process_meter.h"
#include "take/ledger/verify.h"
#include "take/logs/frame_log.h"

namespace v3d {
namespace {

using test::becomes_true;
using test::ProcessMeter;
using test::ProcessSample;
using test::within;
using testing::IsEmpty;

using Pulses = std::vector<int64_t>;

constexpr int kCameras = 15;
constexpr int64_t kRateHz = 25;
constexpr int64_t kShortTake = 12 * kRateHz;
constexpr int64_t kPulsesBetweenFaults = 3 * kRateHz;
/// No fault starts so near the end; an unplugged camera is back before the take ends.
constexpr int64_t kNoFaultAtTheEnd = 6 * kRateHz;
/// Takes before the measurement, until the daemons have allocated their buffers.
constexpr int kWarmUpTakes = 3;
constexpr double kWarmUpSeconds = 20;

int soak_seconds() {
  const char* seconds = std::getenv("V3D_SOAK_SECONDS");
  return seconds != nullptr ? std::atoi(seconds) : 150;
}

/// Upper bound of the memory growth, kB/h: one megabyte an hour.
///
/// Each arena of the allocator takes pages in steps of up to a quarter of a megabyte. In ten
/// minutes the median of all slopes is not affected by them. A shorter measurement may grow by one
/// megabyte more, which is 70 bytes a frame in forty seconds.
double max_kb_per_hour(const std::vector<ProcessSample>& samples) {
  constexpr double kMegabyte = 1024;
  const double seconds = samples.back().seconds - samples.front().seconds;
  return seconds >= 600 ? kMegabyte : kMegabyte + kMegabyte * 3600 / seconds;
}

/// The lengths of all takes, in pulses.
Pulses plan() {
  const int64_t half = soak_seconds() * kRateHz / 2;
  Pulses takes(static_cast<size_t>(std::max<int64_t>(kWarmUpTakes + 2, half / kShortTake)),
               kShortTake);
  takes.push_back(half);
  return takes;
}

/// Faults in turn, each with the fields of its kind, as TOML.
constexpr const char* kFaults[] = {
    "kind = \"drop\"",
    "kind = \"missed\"",
    "kind = \"duplicate\"",
    "kind = \"delay\"\nms = 200",
    "kind = \"freeze\"\npulses = 6",
    "kind = \"unplug\"\nms = 1500",
    "kind = \"clock\"\njump_ms = 500",
    "kind = \"black\"",
    "kind = \"unplug\"\nms = 1500\nnew_clock = true",
    "kind = \"clock\"\njump_ms = -500",
};

/// Every camera gets every kind, if the soak is long enough.
std::string fault(size_t number, int64_t pulse) {
  const size_t camera = 1 + number * 7 % kCameras;
  return "[[fault]]\ncamera = \"cam" + std::to_string(100 + camera).substr(1) +
         "\"\npulse = " + std::to_string(pulse) + "\n" + kFaults[number % std::size(kFaults)] +
         "\n";
}

/// A fault script with faults in every take of the plan, none near the ends of a take.
std::string fault_script() {
  std::string script;
  size_t number = 0;
  int64_t begin = 0;
  for (const int64_t pulses : plan()) {
    for (int64_t pulse = kPulsesBetweenFaults; pulse <= pulses - kNoFaultAtTheEnd;
         pulse += kPulsesBetweenFaults) {
      script += fault(number++, begin + pulse);
    }
    begin += pulses;
  }
  return script;
}

/// The simulator's record of one take. Pulses are identified by the time of their edge, because a
/// trigger on a busy machine skips pulses.
class TakeRecord {
 public:
  TakeRecord(const std::vector<sim::ExposureLine>& lines,
             const std::vector<wire::PulseMessage>& pulses) {
    std::map<MonotonicInstant, int64_t> pulse_at;
    for (const wire::PulseMessage& pulse : pulses) pulse_at[pulse.edge_monotonic] = pulse.pulse;
    for (const sim::ExposureLine& line : lines) {
      const auto at = pulse_at.find(line.edge_time);
      if (at == pulse_at.end()) continue;
      shown_.emplace(std::pair(line.camera, line.device_time), at->second);
      pulses_.insert(at->second);
      sent_[line.camera].push_back(at->second);
    }
    for (auto& [camera, sent] : sent_) std::ranges::sort(sent);
  }
  /// Number of pulses of which at least one camera sent an image.
  int64_t pulses() const { return std::ssize(pulses_); }
  /// The pulse of every image that this camera sent, in ascending order.
  Pulses sent(const std::string& camera) const {
    const auto found = sent_.find(camera);
    return found == sent_.end() ? Pulses() : found->second;
  }
  /// The pulses that these frames show, independent of their labels, in ascending order; -1 for an
  /// unknown image.
  Pulses shown(const std::string& camera, const std::vector<FrameLabel>& labels) const {
    Pulses pulses;
    for (const FrameLabel& label : labels) pulses.push_back(shown_by(camera, label));
    std::ranges::sort(pulses);
    return pulses;
  }
  /// One line for each frame whose label is wrong, and for the frames before and after it.
  std::string explain(const std::string& camera, const std::vector<FrameLabel>& labels) const {
    const auto is_wrong = [&](size_t i) {
      return i < labels.size() && shown_by(camera, labels[i]) != labels[i].pulse;
    };
    std::string lines;
    for (size_t i = 0; i < labels.size(); ++i) {
      if (!is_wrong(i) && !is_wrong(i + 1) && !(i > 0 && is_wrong(i - 1))) continue;
      const FrameLabel& label = labels[i];
      lines +=
          fmt::format("frame {}: pulse {}{}, shows {}; counter {}, device time {}, received {}\n",
                      i, label.pulse, label.suspect ? " (suspect)" : "", shown_by(camera, label),
                      label.camera_counter, to_ns(label.device_time), to_ns(label.received));
    }
    return lines;
  }
  /// Number of frames that show another pulse than their label and are not marked suspect.
  int64_t mislabelled(const std::string& camera, const std::vector<FrameLabel>& labels) const {
    return std::ranges::count_if(labels, [&](const FrameLabel& label) {
      return !label.suspect && shown_by(camera, label) != label.pulse;
    });
  }

 private:
  /// The pulse that the image of this label shows, found by its device time; -1 if unknown.
  ///
  /// A camera whose clock restarts every minute and a half may give the same nanosecond twice in a
  /// take. Then the image counts as the one of its label.
  int64_t shown_by(const std::string& camera, const FrameLabel& label) const {
    const auto [first, end] = shown_.equal_range({camera, label.device_time});
    const auto as_labelled =
        std::find_if(first, end, [&](const auto& one) { return one.second == label.pulse; });
    if (as_labelled != end) return label.pulse;
    return first == end ? -1 : first->second;
  }

  std::set<int64_t> pulses_;
  std::map<std::string, Pulses> sent_;
  std::multimap<std::pair<std::string, DeviceInstant>, int64_t> shown_;
};

/// A daemon under observation.
struct Observed {
  Observed(std::string daemon, pid_t process)
      : name(std::move(daemon)), pid(process), meter(process) {}

  std::string name;
  pid_t pid;
  ProcessMeter meter;
  std::vector<ProcessSample> between_takes;  ///< one sample after every take
};

class Soak : public test::Studio4 {
 protected:
  Soak()
      : Studio4({.cameras = kCameras,
                 .size = "160x120",
                 .voxel = "60mm",
                 .faults = fault_script(),
                 .rate = std::to_string(kRateHz)}) {
    observed_.push_back(std::make_unique<Observed>("v3d-captured", captured_->pid()));
    observed_.push_back(std::make_unique<Observed>("v3d-recond", recond_->pid()));
  }

  void take(int64_t pulses) {
    take_name_ = "soak-" + std::to_string(takes_++);
    const auto armed = [&] { return command(wire::CommandVerb::kArm, pulses).done(); };
    ASSERT_TRUE(becomes_true(armed, within(120))) << log();
    ASSERT_TRUE(command(wire::CommandVerb::kStart).done()) << log();
    const auto seconds = static_cast<int>(pulses / kRateHz);
    ASSERT_TRUE(becomes_true([&] { return is_over(pulses); }, within(2 * seconds + 60))) << log();
    const control::Answer stopped = command(wire::CommandVerb::kStop);
    ASSERT_TRUE(stopped.done()) << text_of(stopped) << log();
    check_ledger();
    std::filesystem::remove_all(Studio4::take().folder);
    for (const auto& daemon : observed_) {
      ProcessSample now = test::sample(daemon->pid);
      now.seconds = daemon->meter.now();
      daemon->between_takes.push_back(now);
    }
  }
  bool is_over(int64_t pulses) {
    return reaches_now("pulses_sensed", static_cast<double>(pulses)) || becomes_idle();
  }
  bool reaches_now(const std::string& name, double wanted) {
    return value("cap01", name) >= wanted;
  }

  /// Every image that was sent is on the disk, with the right pulse number or marked suspect, and
  /// the ledger agrees with the files.
  void check_ledger() {
    const take::TakePaths paths = Studio4::take();
    const take::Verification verified = verify_take(paths);
    const take::Ledger& ledger = verified.ledger;
    EXPECT_THAT(verified.disagreements, IsEmpty());
    EXPECT_EQ(verified.info.state, take::TakeState::kComplete);
    TakeRecord record(sim::load_exposures(folder_ / "exposures.csv"),
                      take::read_pulses(paths.pulses()));
    EXPECT_EQ(ledger.sensed, record.pulses());
    ASSERT_EQ(ledger.cameras.size(), size_t{kCameras});
    for (const take::CameraLedger& camera : ledger.cameras) {
      const take::FrameLogReader log(paths.frames(camera.name));
      const std::string context =
          take_name_ + " " + camera.name + "\n" + record.explain(camera.name, log.labels());
      EXPECT_EQ(record.shown(camera.name, log.labels()), record.sent(camera.name)) << context;
      EXPECT_EQ(record.mislabelled(camera.name, log.labels()), 0) << context;
      frames_ += camera.written;
      missing_ += std::ssize(camera.missing);
      suspect_ += std::ssize(camera.suspect);
    }
    pulses_ += ledger.commanded;
    unsensed_ += std::ssize(ledger.unsensed);
  }

  /// Checks memory growth, descriptors and threads. `long_take`: start of the measurement in the
  /// long take, seconds since the start of the meter.
  static void expect_no_leaks(const Observed& daemon, double long_take) {
    const ProcessSample& first = daemon.between_takes.front();
    const ProcessSample& last = daemon.between_takes.back();
    const std::vector<ProcessSample> takes(daemon.between_takes.begin(),
                                           daemon.between_takes.end() - 1);
    const std::vector<ProcessSample> in_take = daemon.meter.since(long_take);
    const double from_take_to_take = test::resident_kb_per_hour(takes);
    const double in_a_take = test::resident_kb_per_hour(in_take);
    std::printf(
        "%s: %.0f kB resident after the warm-up, %.0f at the end; %+.0f kB/h from take to take, "
        "%+.0f kB/h in the long take; %lld descriptors and %lld threads, %lld and %lld at the "
        "end\n",
        daemon.name.c_str(), first.resident_kb, last.resident_kb, from_take_to_take, in_a_take,
        static_cast<long long>(first.descriptors), static_cast<long long>(first.threads),
        static_cast<long long>(last.descriptors), static_cast<long long>(last.threads));
    EXPECT_EQ(last.descriptors, first.descriptors) << daemon.name;
    EXPECT_EQ(last.threads, first.threads) << daemon.name;
    EXPECT_LT(from_take_to_take, max_kb_per_hour(takes)) << daemon.name << ", from take to take";
    EXPECT_LT(in_a_take, max_kb_per_hour(in_take)) << daemon.name << ", in the long take";
  }

  int takes_ = 0;
  int64_t pulses_ = 0, unsensed_ = 0, frames_ = 0, missing_ = 0, suspect_ = 0;
  std::vector<std::unique_ptr<Observed>> observed_;
};

TEST_F(Soak, with_fifteen_faulty_cameras_leaks_no_memory_and_no_descriptors) {
  const Pulses takes = plan();
  for (size_t i = 0; i + 1 < takes.size(); ++i) {
    take(takes[i]);
    if (HasFatalFailure()) return;
  }
  const double long_take = observed_.front()->meter.now() + kWarmUpSeconds;
  for (const auto& daemon : observed_) {
    daemon->between_takes.erase(daemon->between_takes.begin(),
                                daemon->between_takes.begin() + kWarmUpTakes);
  }
  take(takes.back());
  std::printf("%d takes, %lld pulses, %lld not sensed, %lld frames, %lld missing, %lld suspect\n",
              takes_, static_cast<long long>(pulses_), static_cast<long long>(unsensed_),
              static_cast<long long>(frames_), static_cast<long long>(missing_),
              static_cast<long long>(suspect_));
  for (const auto& daemon : observed_) expect_no_leaks(*daemon, long_take);
}

}  // namespace
}  // namespace v3d
