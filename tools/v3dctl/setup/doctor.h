// Checks of `v3dctl doctor`: requirements of a PC of the studio, each with its remedy.
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/config/studio_file.h"
#include "base/core/time.h"
#include "base/io/file.h"
#include "wire/messages.h"

namespace v3d::ctl {

struct Finding {
  enum class Verdict { kGood, kBad, kUnknown } verdict = Verdict::kGood;
  std::string subject;  ///< "receive buffer"
  std::string text;     ///< what was found
  std::string remedy;   ///< what to do; empty without a fault
  /// Measured values with their units in the names, for --json; mostly none.
  std::vector<std::pair<std::string, double>> values = {};
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
/// Models, firmware and ignored settings of the cameras, from the files that the capture nodes on
/// this PC wrote to the folder of takes. Nothing for nodes without a file.
std::vector<Finding> check_camera_settings(const Studio& studio,
                                           const std::vector<StudioCamera>& cameras);
/// MTU of each interface with a route to a camera, against the packet size of its cameras.
std::vector<Finding> check_mtu(const std::vector<StudioCamera>& cameras);
/// The same for one interface; sizes in bytes.
Finding check_mtu(const std::string& interface, int mtu, int packet_size);
/// IP address of this PC on the route to `address`; 0 when there is none.
uint32_t source_address_to(const std::string& address);

// --- sound: doctor_devices.cc

/// Whether the sound devices of the studio open, the inputs of [[sound]] and that of
/// [timecode_output]; a device that a daemon uses is good. And whether the sound gets the times of
/// the pulses. `node`: only those of this node, on this
/// PC; empty: those of all nodes, where one that does not open may be on another PC.
std::vector<Finding> check_sound_devices(const Studio& studio, const std::string& node);

// --- lights: doctor_devices.cc

/// Whether olad answers v3d-lights, on the PC of this node; empty when the node has no lamps.
std::optional<Finding> check_lights(const Studio& studio, const std::string& node);

// --- clock: doctor_machine.cc

/// Queries chronyd, systemd-timesyncd and ptp4l, up to 200 ms.
Finding check_clock();
/// `values`: as reported by ClockMonitor and PtpMonitor. `kernel_synchronised`: flag of the kernel,
/// which is also set by a ptp4l that this user may not query.
Finding check_clock(const std::map<std::string, double>& values, bool kernel_synchronised);

/// Whether scheduled action commands have the time scale of PTP. `tai_offset_s`: seconds by which
/// CLOCK_TAI of this PC is ahead of UTC. Empty without an action trigger.
std::vector<Finding> check_ptp_scale(const StudioTrigger& trigger, int tai_offset_s);
/// The same for this PC.
std::vector<Finding> check_ptp_scale(const StudioTrigger& trigger);

// --- disk, memory and priorities: doctor_machine.cc

/// All checks of this kind, for the cameras of `node`, which is this PC; empty: for those of all
/// nodes, where a disk that is too slow for one of them, or too little memory for USB, may be that
/// of another PC. Writes to the disk of the takes for about 1 s.
std::vector<Finding> check_machine(const Studio& studio, const std::string& node);
/// Free space of the folder of takes.
Finding check_disk(const std::string& path);
/// Data rate of the cameras of `node` by their calibrated image sizes, bytes per second; 0 when
/// these are unknown. Empty `node`: the largest rate of any one node.
double needed_disk_speed(const Studio& studio, const std::string& node);
/// Write rate, measured with a temporary file in `folder`. `needed`: bytes per second. `is_here`:
/// the cameras that need it are those of this PC. Otherwise a slower disk is kUnknown.
Finding check_disk_speed(const std::filesystem::path& folder, double needed, bool is_here);
Finding judge_disk_speed(double bytes_per_second, double needed, bool is_here);
/// For a file that could not be written: kUnknown where this user may not write or the folder is
/// missing, otherwise kBad.
Finding judge_disk_error(const io::IoError& error);
/// Permission to use real-time priorities. `limit`: RLIMIT_RTPRIO of this user.
Finding check_realtime(unsigned long limit, bool root);
/// Whether one of the cameras has a serial number in place of an IP address. Such a camera may be a
/// USB camera.
bool may_have_usb_cameras(const std::vector<StudioCamera>& cameras);
/// `mb`: usbcore.usbfs_memory_mb of this PC, the limit of all its USB cameras together; -1 without
/// USB. `node`: as for check_machine(). Without it, too little memory is kUnknown where several
/// nodes have cameras.
Finding check_usb_memory(long mb, const Studio& studio, const std::string& node);

// --- lateness of timers: doctor_machine.cc

/// Sleeps `cycles` times until the next multiple of `period`. Returns how much later than its timer
/// the calling thread ran each time. After a delay of more than a period, the multiples count from
/// there.
std::vector<Duration> measure_wakeups(const HostClock& clock, int cycles, Duration period);
/// Percentiles and maximum, with the limit of a late pulse. `is_realtime`: the thread had the
/// priority of the trigger. Without it, a lateness above the limit proves nothing: kUnknown.
Finding judge_wakeups(const std::vector<Duration>& lateness, bool is_realtime, Duration limit);
/// 10,000 cycles of 1 ms with the priority and on the processor of the trigger's thread: 10 s. The
/// limit is max_pulse_lateness() at the studio's rate. `is_trigger_here`: this PC has the trigger.
/// Otherwise, or where that is unknown, no lateness is a fault.
Finding check_wakeups(const Studio& studio, bool is_trigger_here);

// Checks of keys: the studio key of every PC of the studio, and the member list of this PC.

/// Finding: the file exists, contains a key, and other users cannot read it. kUnknown where this
/// user may not read it.
Finding check_key_file(const std::filesystem::path& key);

/// Finding: the member list has a valid signature of the authority. Requires a studio with a member
/// list.
Finding check_member_list(const Studio& studio);

/// One finding for each node. `health`: verified and unverified health messages by node. A node
/// whose message has a valid MAC has the studio key of this PC. A node without an entry is unknown.
std::vector<Finding> check_keys_of(const std::vector<std::string>& nodes,
                                   const std::map<std::string, wire::HealthMessage>& health);

/// All findings of this file. Receives health for up to three seconds. Never throws for a node
/// without health messages: its finding is kUnknown.
std::vector<Finding> examine_keys(const Studio& studio);

// --- all nodes: doctor_nodes.cc

/// Findings about each node, from the values of its health: state, cameras, disk, temperature,
/// memory, clock, update; and whether those with an entry have the same version. A node without one
/// is kBad, the clock of a node without has_clock_state() is kUnknown.
std::vector<Finding> check_nodes(const std::vector<std::string>& nodes,
                                 const std::map<std::string, wire::HealthMessage>& health);

}  // namespace v3d::ctl
