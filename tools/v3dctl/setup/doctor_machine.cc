#include "v3dctl/setup/doctor_machine.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <ifaddrs.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/timex.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <memory>

#include "base/calib_file.h"
#include "base/error.h"
#include "base/units.h"
#include "daemon/clock_watch.h"
#include "daemon/ptp_watch.h"
#include "v3dctl/operate/health_text.h"

namespace v3d::ctl {
namespace {

using Verdict = Finding::Verdict;

constexpr double kGoodOffsetUs = 1000;
constexpr long kWantedUsbMemory = 1000;  // MB: some twenty buffers for each of a few cameras

long read_number(const std::filesystem::path& path) {
  long number = -1;
  std::ifstream(path) >> number;
  return number;
}

/// The address that this PC has on the way to `address`; 0 when there is no way.
uint32_t source_address_to(const std::string& address) {
  sockaddr_in to{};
  to.sin_family = AF_INET;
  to.sin_port = htons(3956);
  if (inet_pton(AF_INET, address.c_str(), &to.sin_addr) != 1) return 0;
  const int fd = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  sockaddr_in from{};
  socklen_t size = sizeof from;
  const bool known = connect(fd, reinterpret_cast<const sockaddr*>(&to), sizeof to) == 0 &&
                     getsockname(fd, reinterpret_cast<sockaddr*>(&from), &size) == 0;
  close(fd);
  return known ? from.sin_addr.s_addr : 0;
}

std::string interface_with(uint32_t address) {
  ifaddrs* list = nullptr;
  if (address == 0 || getifaddrs(&list) != 0) return "";
  const std::unique_ptr<ifaddrs, decltype(&freeifaddrs)> owner(list, freeifaddrs);
  for (const ifaddrs* entry = list; entry != nullptr; entry = entry->ifa_next) {
    if (entry->ifa_addr == nullptr || entry->ifa_addr->sa_family != AF_INET) continue;
    const auto* own = reinterpret_cast<const sockaddr_in*>(entry->ifa_addr);
    if (own->sin_addr.s_addr == address) return entry->ifa_name;
  }
  return "";
}

/// What chronyd says within a moment.
std::map<std::string, double> ask_for_the_time() {
  ClockWatch watch;
  watch.wait(std::chrono::milliseconds(100));
  PtpWatch ptp;
  ptp.wait(std::chrono::milliseconds(100));
  std::map<std::string, double> values;
  watch.report(values);
  ptp.report(values);
  return values;
}

bool kernel_holds_clock() {
  timex clock{};
  return adjtimex(&clock) != TIME_ERROR && (clock.status & STA_UNSYNC) == 0;
}

/// What `cameras` record, by their calibrated sizes; 0 when those are not known.
double bytes_per_second(const Studio& studio, const std::vector<StudioCamera>& cameras) {
  try {
    const Rig rig = load_calib(studio.storage.calib);
    double bytes = 0;
    for (const StudioCamera& camera : cameras) {
      const int index = find_camera(rig, camera.name);
      if (index < 0) continue;
      const ImageSize size = rig[static_cast<size_t>(index)].model.size();
      bytes += static_cast<double>(byte_count(size, camera.pixel_format)) * studio.trigger.rate_hz;
    }
    return bytes;
  } catch (const InputError&) {
    return 0;
  }
}

/// Bytes per second that reach the disk, over about a second; negative with errno set when it
/// cannot be written.
double measure_writes(const std::filesystem::path& file) {
  const int fd = open(file.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
  if (fd < 0) return -1;
  const std::vector<char> block(4 << 20, 'v');
  double bytes = 0;
  bool good = true;
  const auto begin = std::chrono::steady_clock::now();
  const auto seconds = [&] {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  };
  // No more than 512 MB: enough to be past the cache of a disk that is too slow for a studio.
  while (good && seconds() < 1 && bytes < 512e6) {
    for (int i = 0; i < 8 && good; ++i) {
      const ssize_t written = write(fd, block.data(), block.size());
      good = written > 0;
      bytes += static_cast<double>(std::max<ssize_t>(0, written));
    }
    good = good && fdatasync(fd) == 0;
  }
  const double rate = bytes / seconds();
  const int error = errno;
  close(fd);
  unlink(file.c_str());
  errno = error;
  return good ? rate : -1;
}

/// Of ptp4l alone. Where chronyd holds the clock, too, it is chronyd's.
Finding check_ptp(const std::map<std::string, double>& values) {
  const auto offset = values.find("ptp_offset_us");
  if (offset == values.end()) {
    return {Verdict::kGood, "clock", "this PC is the PTP master, or ptp4l has found none", ""};
  }
  const std::string text =
      "held by ptp4l, " + value_text("offset_us", offset->second) + " from its master";
  if (std::abs(offset->second) < kGoodOffsetUs) return {Verdict::kGood, "clock", text, ""};
  return {Verdict::kBad, "clock", text, "journalctl -u ptp4l: does it still hear its master?"};
}

}  // namespace

Finding check_mtu(const std::string& interface, int mtu, int packet_size) {
  const std::string text = interface + " takes packets of " + std::to_string(mtu) + " bytes";
  if (mtu >= packet_size) return {Verdict::kGood, "MTU", text, ""};
  return {
      Verdict::kBad, "MTU", text + ", its cameras are told to send " + std::to_string(packet_size),
      "sudo ip link set dev " + interface + " mtu " + std::to_string(packet_size) +
          " (and on the switch), or packet_size = " + std::to_string(mtu) + " in the studio file"};
}

std::vector<Finding> check_mtu(const std::vector<StudioCamera>& cameras) {
  std::map<std::string, int> packet_sizes;  // the largest, by interface
  for (const StudioCamera& camera : cameras) {
    if (camera.kind != CameraKind::kAravis) continue;
    const std::string interface = interface_with(source_address_to(camera.address));
    if (interface.empty()) continue;  // a serial number; or no route, which the camera check tells
    packet_sizes[interface] = std::max(packet_sizes[interface], camera.packet_size);
  }
  std::vector<Finding> findings;
  for (const auto& [interface, packet_size] : packet_sizes) {
    const long mtu = read_number("/sys/class/net/" + interface + "/mtu");
    findings.push_back(check_mtu(interface, static_cast<int>(mtu), packet_size));
  }
  return findings;
}

Finding check_realtime(unsigned long limit, bool root) {
  if (root || limit > 0) {
    return {Verdict::kGood, "real time", "threads may be given a real-time priority", ""};
  }
  return {Verdict::kUnknown, "real time", "not permitted to this user (RLIMIT_RTPRIO is 0)",
          "the unit v3d-captured@.service grants it; by hand: '@v3d - rtprio 50' in "
          "/etc/security/limits.d/v3d.conf"};
}

Finding check_clock(const std::map<std::string, double>& values, bool kernel_holds) {
  const auto flag = values.find("clock_synchronised_flag");
  const auto offset = values.find("clock_offset_us");
  const std::string start =
      "sudo apt install chrony, with the same server on every PC of the studio";
  if (flag != values.end() && flag->second == 0) {
    return {Verdict::kBad, "clock", "chronyd has no source that it trusts",
            "chronyc sources: its servers must be reachable"};
  }
  if (offset != values.end()) {
    const std::string text =
        "held by chronyd, " + value_text("offset_us", offset->second) + " from the right time";
    if (std::abs(offset->second) < kGoodOffsetUs) return {Verdict::kGood, "clock", text, ""};
    return {Verdict::kBad, "clock", text, "sudo chronyc makestep, before the next take"};
  }
  if (flag != values.end()) return {Verdict::kGood, "clock", "held by systemd-timesyncd", ""};
  if (values.contains("ptp_steps_removed")) return check_ptp(values);
  if (kernel_holds) {
    return {Verdict::kGood, "clock", "held, the kernel says; by whom and how well is not known",
            ""};
  }
  return {Verdict::kBad, "clock", "nobody holds this PC's clock", start};
}

Finding judge_disk_speed(double bytes_per_second, double needed) {
  const std::string speed = format_bytes(bytes_per_second) + "/s reach the disk";
  if (needed <= 0) return {Verdict::kGood, "disk speed", speed, ""};
  const std::string text = speed + ", the cameras make " + format_bytes(needed) + "/s";
  if (bytes_per_second >= needed) return {Verdict::kGood, "disk speed", text, ""};
  return {Verdict::kBad, "disk speed", text,
          "a faster disk for takes under [storage], fewer cameras on this PC, or a lower rate"};
}

Finding check_disk_speed(const std::filesystem::path& folder, double needed) {
  const std::filesystem::path file =
      folder / (".v3dctl-doctor." + std::to_string(getpid()) + ".tmp");
  const double speed = measure_writes(file);
  if (speed >= 0) return judge_disk_speed(speed, needed);
  return {Verdict::kUnknown, "disk speed", errno_message(folder.string()),
          "run the doctor as a member of the group v3d, or by sudo"};
}

Finding check_usb_memory(long mb, bool has_usb_cameras) {
  if (mb < 0) return {Verdict::kUnknown, "USB memory", "no USB on this PC", ""};
  const std::string text = "USB cameras may use " + std::to_string(mb) + " MB";
  if (mb == 0) return {Verdict::kGood, "USB memory", "USB cameras may use any amount", ""};
  if (mb >= kWantedUsbMemory) return {Verdict::kGood, "USB memory", text, ""};
  if (!has_usb_cameras) return {Verdict::kGood, "USB memory", text + "; there are none here", ""};
  return {Verdict::kBad, "USB memory", text + ": frames will be lost",
          "echo 1000 | sudo tee /sys/module/usbcore/parameters/usbfs_memory_mb, and for good: "
          "usbcore.usbfs_memory_mb=1000 on the kernel's command line"};
}

std::vector<Finding> examine_machine(const Studio& studio,
                                     const std::vector<StudioCamera>& cameras) {
  std::vector<Finding> findings = check_mtu(cameras);
  rlimit realtime{};
  getrlimit(RLIMIT_RTPRIO, &realtime);
  findings.push_back(check_realtime(realtime.rlim_cur, geteuid() == 0));
  findings.push_back(check_clock(ask_for_the_time(), kernel_holds_clock()));
  findings.push_back(check_disk_speed(studio.storage.takes, bytes_per_second(studio, cameras)));
  // Whoever is given by a serial number may hang on USB.
  const bool has_usb_cameras =
      std::any_of(cameras.begin(), cameras.end(), [](const StudioCamera& camera) {
        return camera.kind == CameraKind::kAravis && source_address_to(camera.address) == 0;
      });
  findings.push_back(check_usb_memory(read_number("/sys/module/usbcore/parameters/usbfs_memory_mb"),
                                      has_usb_cameras));
  return findings;
}

}  // namespace v3d::ctl
