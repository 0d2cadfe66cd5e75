// Checks of `v3dctl doctor`: requirements of a PC of the studio, each with its remedy.
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "base/config/studio_file.h"

namespace v3d::ctl {

struct Finding {
  enum class Verdict { kGood, kBad, kUnknown } verdict = Verdict::kGood;
  std::string subject;  ///< "receive buffer"
  std::string text;     ///< what was found
  std::string remedy;   ///< what to do; empty without a fault
};

// --- network: doctor_network.cc

/// All checks of the network, for these cameras. Waits up to 1 s for the replies of cameras.
std::vector<Finding> check_network(const Studio& studio, const std::vector<StudioCamera>& cameras);
/// `bytes`: net.core.rmem_max; negative: unknown.
Finding check_receive_buffer(long long bytes);
/// Route to the multicast group of an LCM URL.
Finding check_multicast(const std::string& lcm_url);
/// Permission to open packet sockets.
Finding check_packet_socket();
/// Replies of cameras with an IP address to a GigE Vision register read, and access to V4L2
/// devices.
std::vector<Finding> check_cameras(const std::vector<StudioCamera>& cameras);
/// MTU of each interface with a route to a camera, against the packet size of its cameras.
std::vector<Finding> check_mtu(const std::vector<StudioCamera>& cameras);
/// The same for one interface; sizes in bytes.
Finding check_mtu(const std::string& interface, int mtu, int packet_size);
/// IP address of this PC on the route to `address`; 0 when there is none.
uint32_t source_address_to(const std::string& address);

// --- clock: doctor_clock.cc

/// Asks chronyd, systemd-timesyncd and ptp4l, up to 200 ms.
Finding check_clock();
/// `values`: as reported by ClockMonitor and PtpMonitor. `kernel_synchronised`: flag of the kernel,
/// which is also set by a ptp4l that this user may not ask.
Finding check_clock(const std::map<std::string, double>& values, bool kernel_synchronised);

// --- disk, memory and priorities: doctor_machine.cc

/// All checks of this kind, for these cameras. Writes to the disk of the takes for about 1 s.
std::vector<Finding> check_machine(const Studio& studio, const std::vector<StudioCamera>& cameras);
/// Free space of the folder of takes.
Finding check_disk(const std::string& path);
/// Write rate, measured with a temporary file in `folder`. `needed`: bytes per second.
Finding check_disk_speed(const std::filesystem::path& folder, double needed);
Finding judge_disk_speed(double bytes_per_second, double needed);
/// Permission to use real-time priorities. `limit`: RLIMIT_RTPRIO of this user.
Finding check_realtime(unsigned long limit, bool root);
/// `mb`: usbcore.usbfs_memory_mb, the limit of all USB cameras together; -1 without USB.
Finding check_usb_memory(long mb, bool has_usb_cameras);

}  // namespace v3d::ctl
