#include <sys/timex.h>

#include <cmath>

#include "daemon/control/clock_monitor.h"
#include "daemon/control/ptp_monitor.h"
#include "v3dctl/operate/health_text.h"
#include "v3dctl/setup/doctor.h"

namespace v3d::ctl {
namespace {

using Verdict = Finding::Verdict;

constexpr double kMaxOffsetUs = 1000;

std::map<std::string, double> read_clock_values() {
  ClockMonitor watch;
  watch.wait(std::chrono::milliseconds(100));
  PtpMonitor ptp;
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
    return {Verdict::kGood, "clock", "this PC is the PTP master, or ptp4l has none", ""};
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
      "sudo apt install chrony, with the same server on every PC of the studio";
  if (flag != values.end() && flag->second == 0) {
    return {Verdict::kBad, "clock", "chronyd has no usable source",
            "chronyc sources: check that its servers are reachable"};
  }
  if (offset != values.end()) {
    const std::string text =
        "synchronised by chronyd, " + value_text("offset_us", offset->second) + " from its servers";
    if (std::abs(offset->second) < kMaxOffsetUs) return {Verdict::kGood, "clock", text, ""};
    return {Verdict::kBad, "clock", text, "sudo chronyc makestep, before the next take"};
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

Finding check_clock() { return check_clock(read_clock_values(), kernel_synchronised()); }

}  // namespace v3d::ctl
