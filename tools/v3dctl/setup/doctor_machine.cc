#include <arpa/inet.h>
#include <fmt/core.h>
#include <sched.h>
#include <sys/resource.h>
#include <sys/statvfs.h>
#include <sys/timex.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <fstream>
#include <thread>

#include "base/config/calib_file.h"
#include "base/core/error.h"
#include "base/core/statistics.h"
#include "base/core/text.h"
#include "base/core/time.h"
#include "base/io/file.h"
#include "base/io/process.h"
#include "daemon/control/clock_monitor.h"
#include "v3dctl/operate/health_text.h"
#include "v3dctl/setup/doctor.h"

namespace v3d::ctl {
namespace {

using Verdict = Finding::Verdict;

constexpr double kMinFreeBytes = 20e9;
constexpr long kMinUsbMemoryMb = 1000;  // about twenty buffers for each of a few cameras
constexpr uint64_t kMaxBytesWritten = 512'000'000;  // exceeds the cache of a disk that is too slow

long read_number(const std::filesystem::path& path) {
  long number = -1;
  std::ifstream(path) >> number;
  return number;
}

/// Bytes of one frame of each camera that is calibrated.
double frame_bytes(const Rig& rig, const std::vector<StudioCamera>& cameras) {
  double bytes = 0;
  for (const StudioCamera& camera : cameras) {
    const int index = find_camera(rig, camera.name);
    if (index < 0) continue;
    const ImageSize size = rig[static_cast<size_t>(index)].model.size();
    bytes += static_cast<double>(byte_count(size, camera.pixel_format.image));
  }
  return bytes;
}

/// Whether the cameras of `node` are those of this PC. Without `node`, only in a studio where one
/// node has cameras.
bool has_cameras_here(const Studio& studio, const std::string& node) {
  return !node.empty() || std::ranges::count_if(studio.nodes, [&](const StudioNode& each) {
                            return !studio.cameras_of(each.name).empty();
                          }) <= 1;
}

/// Writes some blocks behind the first `bytes` of the file, and waits for the disk.
io::Status write_blocks(io::File& file, uint64_t& bytes) {
  static const std::vector<uint8_t> block(4 << 20, 'v');
  for (int i = 0; i < 8; ++i, bytes += block.size()) {
    if (io::Status written = file.write(bytes, {block}); !written) return written;
  }
  return file.sync();
}

/// Write rate in bytes per second, measured for about 1 s with a new file.
io::Result<double> measure_writes(const std::filesystem::path& path) {
  auto file = io::File::open(path, io::OpenMode::kCreatePrivate);
  if (!file) return tl::make_unexpected(file.error());
  unlink(path.c_str());  // the space is free when the file is closed, also after a kill
  uint64_t bytes = 0;
  const MonotonicInstant begin = Monotonic::now();
  const auto seconds = [&] { return to_seconds(Monotonic::now() - begin); };
  while (seconds() < 1 && bytes < kMaxBytesWritten) {
    if (auto written = write_blocks(*file, bytes); !written) {
      return tl::make_unexpected(written.error());
    }
  }
  return static_cast<double>(bytes) / seconds();
}

}  // namespace

Finding check_disk(const std::string& path) {
  struct statvfs disk {};
  if (statvfs(path.c_str(), &disk) != 0) {
    return {Verdict::kBad, "disk", errno_message(path),
            "mkdir -p " + path + ", owned by the user v3d"};
  }
  const double free = static_cast<double>(disk.f_bavail) * static_cast<double>(disk.f_frsize);
  const std::string text = path + " has " + format_bytes(free) + " free";
  if (free >= kMinFreeBytes) return {Verdict::kGood, "disk", text, ""};
  return {Verdict::kBad, "disk", text, "move takes to another disk; v3dctl takes lists them"};
}

Finding check_realtime(unsigned long limit, bool root) {
  if (root || limit > 0) {
    return {Verdict::kGood, "real time", "threads may use real-time priorities", ""};
  }
  return {Verdict::kUnknown, "real time", "not permitted to this user (RLIMIT_RTPRIO is 0)",
          "the unit v3d-captured@.service grants it; by hand: '@v3d - rtprio 50' in "
          "/etc/security/limits.d/v3d.conf"};
}

double needed_disk_speed(const Studio& studio, const std::string& node) {
  try {
    const Rig rig = load_calib(studio.storage.calib);
    double bytes = 0;
    for (const StudioNode& each : studio.nodes) {
      if (!node.empty() && each.name != node) continue;
      bytes = std::max(bytes, frame_bytes(rig, studio.cameras_of(each.name)));
    }
    return bytes * studio.trigger.rate_hz;
  } catch (const InputError&) {
    return 0;
  }
}

Finding judge_disk_speed(double bytes_per_second, double needed, bool is_here) {
  const std::string speed = format_bytes(bytes_per_second) + "/s are written to the disk";
  if (needed <= 0) return {Verdict::kGood, "disk speed", speed, ""};
  const std::string text = speed + "; the cameras " + (is_here ? "" : "of a node ") + "send " +
                           format_bytes(needed) + "/s";
  if (bytes_per_second >= needed) return {Verdict::kGood, "disk speed", text, ""};
  if (!is_here) {
    return {Verdict::kUnknown, "disk speed", text,
            "it matters on a PC with cameras: v3dctl doctor NODE, with the name of its node"};
  }
  return {Verdict::kBad, "disk speed", text,
          "a faster disk for takes under [storage], fewer cameras on this PC, or a lower rate"};
}

Finding check_disk_speed(const std::filesystem::path& folder, double needed, bool is_here) {
  const std::filesystem::path file =
      folder / (".v3dctl-doctor." + std::to_string(getpid()) + ".tmp");
  const auto speed = measure_writes(file);
  return speed ? judge_disk_speed(*speed, needed, is_here) : judge_disk_error(speed.error());
}

Finding judge_disk_error(const io::IoError& error) {
  // check_disk() reports a missing folder.
  const bool is_missing = error.code == ENOENT || error.code == ENOTDIR;
  if (is_missing || error.code == EACCES || error.code == EPERM) {
    return {Verdict::kUnknown, "disk speed", error.message,
            "run v3dctl doctor as a member of the group v3d, or as root"};
  }
  return {Verdict::kBad, "disk speed", error.message,
          "the disk cannot be written: dmesg shows its errors, df and df -i whether it is full; "
          "check or replace it"};
}

bool may_have_usb_cameras(const std::vector<StudioCamera>& cameras) {
  return std::ranges::any_of(cameras, [](const StudioCamera& camera) {
    in_addr address{};
    return camera.kind == CameraKind::kAravis &&
           inet_pton(AF_INET, camera.address.c_str(), &address) != 1;
  });
}

Finding check_usb_memory(long mb, const Studio& studio, const std::string& node) {
  if (mb < 0) return {Verdict::kUnknown, "USB memory", "no USB on this PC", ""};
  const std::string text = "USB cameras may use " + std::to_string(mb) + " MB";
  if (mb == 0) return {Verdict::kGood, "USB memory", "USB cameras may use any amount", ""};
  if (mb >= kMinUsbMemoryMb) return {Verdict::kGood, "USB memory", text, ""};
  if (!may_have_usb_cameras(node.empty() ? studio.cameras : studio.cameras_of(node)))
    return {Verdict::kGood, "USB memory", text + "; there are none on this PC", ""};
  if (!has_cameras_here(studio, node)) {
    return {Verdict::kUnknown, "USB memory", text,
            "it matters on a PC with USB cameras: v3dctl doctor NODE, with the name of its node"};
  }
  return {Verdict::kBad, "USB memory", text + ": frames will be lost",
          "as root: echo 1000 >/sys/module/usbcore/parameters/usbfs_memory_mb; permanently: "
          "usbcore.usbfs_memory_mb=1000 on the kernel's command line"};
}

std::vector<Finding> check_machine(const Studio& studio, const std::string& node) {
  rlimit realtime{};
  getrlimit(RLIMIT_RTPRIO, &realtime);
  return {check_disk(studio.storage.takes),
          check_disk_speed(studio.storage.takes, needed_disk_speed(studio, node),
                           has_cameras_here(studio, node)),
          check_realtime(realtime.rlim_cur, geteuid() == 0),
          check_usb_memory(read_number("/sys/module/usbcore/parameters/usbfs_memory_mb"), studio,
                           node)};
}

namespace {

constexpr double kMaxOffsetUs = 1000;

std::map<std::string, double> read_clock_values() {
  control::ClockMonitor watch;
  watch.wait(std::chrono::milliseconds(100));
  control::PtpMonitor ptp;
  ptp.wait(std::chrono::milliseconds(100));
  std::map<std::string, double> values;
  watch.report(values);
  ptp.report(values);
  return values;
}

bool kernel_synchronised() {
  timex clock{};
  return adjtimex(&clock) != TIME_ERROR && (clock.status & STA_UNSYNC) == 0;
}

/// For a clock that ptp4l alone synchronises.
Finding check_ptp(const std::map<std::string, double>& values) {
  const auto offset = values.find("ptp_offset_us");
  if (offset == values.end()) {
    return {Verdict::kUnknown, "clock", "this PC is the PTP master, or ptp4l has lost its master",
            "right on the PTP master only; elsewhere: journalctl -u ptp4l"};
  }
  const std::string text =
      "synchronised by ptp4l, " + value_text("offset_us", offset->second) + " from its master";
  if (std::abs(offset->second) < kMaxOffsetUs) return {Verdict::kGood, "clock", text, ""};
  return {Verdict::kBad, "clock", text, "journalctl -u ptp4l: check that it receives its master"};
}

}  // namespace

Finding check_clock(const std::map<std::string, double>& values, bool kernel_synchronised) {
  const auto flag = values.find("clock_synchronised_flag");
  const auto offset = values.find("clock_offset_us");
  const std::string install =
      "as root: apt install chrony, with the same server on every PC of the studio";
  if (flag != values.end() && flag->second == 0) {
    return {Verdict::kBad, "clock", "chronyd has no usable source",
            "chronyc sources: check that its servers are reachable"};
  }
  if (offset != values.end()) {
    const std::string text =
        "synchronised by chronyd, " + value_text("offset_us", offset->second) + " from its servers";
    if (std::abs(offset->second) < kMaxOffsetUs) return {Verdict::kGood, "clock", text, ""};
    return {
        Verdict::kBad, "clock", text,
        "before the next take, wait until chronyd has corrected it, or as root: chronyc makestep"};
  }
  if (flag != values.end())
    return {Verdict::kGood, "clock", "synchronised by systemd-timesyncd", ""};
  if (values.contains("ptp_steps_removed")) return check_ptp(values);
  if (kernel_synchronised) {
    return {Verdict::kGood, "clock",
            "synchronised according to the kernel; source and accuracy are unknown", ""};
  }
  return {Verdict::kBad, "clock", "is not synchronised", install};
}

std::vector<Finding> check_ptp_scale(const StudioTrigger& trigger, int tai_offset_s) {
  if (trigger.kind != TriggerKind::kAction) return {};
  if (trigger.action.clock == PtpScale::kUtc) {
    return {{Verdict::kGood, "PTP time", "action commands have the time of CLOCK_REALTIME", ""}};
  }
  if (tai_offset_s != 0) {
    return {{Verdict::kGood, "PTP time",
             "CLOCK_TAI is " + std::to_string(tai_offset_s) + " s ahead of UTC", ""}};
  }
  return {{Verdict::kBad, "PTP time",
           "CLOCK_TAI is equal to UTC, so scheduled action commands are 37 s late",
           "run ptp4l and phc2sys on the trigger's PC; where the PTP master counts UTC, set "
           "ptp_scale = \"utc\" in [trigger]"}};
}

std::vector<Finding> check_ptp_scale(const StudioTrigger& trigger) {
  timex clock{};
  adjtimex(&clock);
  return check_ptp_scale(trigger, clock.tai);
}

Finding check_clock() { return check_clock(read_clock_values(), kernel_synchronised()); }

// Lateness of timer wake-ups, measured as cyclictest does.

namespace {

constexpr int kCycles = 10'000;
constexpr Duration kPeriod = std::chrono::milliseconds(1);

double microseconds(Duration d) { return std::chrono::duration<double, std::micro>(d).count(); }

}  // namespace

std::vector<Duration> measure_wakeups(const HostClock& clock, int cycles, Duration period) {
  std::vector<Duration> lateness;
  lateness.reserve(static_cast<size_t>(cycles));
  MonotonicInstant due = clock.now();
  for (int i = 0; i < cycles; ++i) {
    due += period;
    clock.sleep_until(due);
    const MonotonicInstant now = clock.now();
    lateness.push_back(now - due);
    // After a long delay, the wake-ups that it has covered are not repeated at once.
    if (now - due > period) due = now;
  }
  return lateness;
}

Finding judge_wakeups(const std::vector<Duration>& lateness, bool is_realtime, Duration limit) {
  const double p50 = microseconds(percentile(lateness, 0.5));
  const double p99 = microseconds(percentile(lateness, 0.99));
  const double p999 = microseconds(percentile(lateness, 0.999));
  const double max = microseconds(percentile(lateness, 1));
  Finding finding{Verdict::kGood,
                  "wake-ups",
                  fmt::format("{} timers, late by {:.0f} us (median), {:.0f} us (99 %), {:.0f} us "
                              "(99.9 %), at most {:.0f} us; the limit is {:.0f} us",
                              lateness.size(), p50, p99, p999, max, microseconds(limit)),
                  "",
                  {{"cycles", static_cast<double>(lateness.size())},
                   {"lateness_p50_us", p50},
                   {"lateness_p99_us", p99},
                   {"lateness_p999_us", p999},
                   {"lateness_max_us", max},
                   {"limit_us", microseconds(limit)},
                   {"realtime_flag", is_realtime ? 1.0 : 0.0}}};
  if (max <= microseconds(limit)) return finding;
  if (is_realtime) {
    finding.verdict = Verdict::kBad;
    finding.remedy =
        "isolate a processor for the trigger (docs/appliance.md, real time), or lower the rate";
  } else {
    finding.verdict = Verdict::kUnknown;
    finding.remedy = "run v3dctl doctor as root: this user has no real-time priority";
  }
  return finding;
}

Finding check_wakeups(const Studio& studio, bool is_trigger_here) {
  std::vector<Duration> lateness;
  bool is_realtime = false;
  std::thread([&] {
    make_thread_realtime();
    is_realtime = sched_getscheduler(0) == SCHED_FIFO;
    lateness = measure_wakeups({}, kCycles, kPeriod);
  }).join();
  Finding finding = judge_wakeups(lateness, is_realtime,
                                  max_pulse_lateness(from_seconds(1 / studio.trigger.rate_hz)));
  if (!is_trigger_here && finding.verdict == Verdict::kBad) {
    finding.verdict = Verdict::kUnknown;
    finding.remedy = "it matters on the PC with the trigger: v3dctl doctor " + studio.trigger.node;
  }
  return finding;
}

}  // namespace v3d::ctl
