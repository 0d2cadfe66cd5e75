// What the doctor looks at in this PC itself: network interfaces, limits, clock, disk.
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "base/studio_file.h"
#include "v3dctl/setup/doctor.h"

namespace v3d::ctl {

/// The interfaces that lead to the cameras take packets as large as the cameras send.
std::vector<Finding> check_mtu(const std::vector<StudioCamera>& cameras);
/// A single interface, for tests.
Finding check_mtu(const std::string& interface, int mtu, int packet_size);

/// Threads may be given a real-time priority. `limit`: RLIMIT_RTPRIO of this user.
Finding check_realtime(unsigned long limit, bool root);

/// `values`: what ClockWatch and PtpWatch report. `kernel_holds`: the kernel says that its clock is
/// held (as by a ptp4l that this user may not ask).
Finding check_clock(const std::map<std::string, double>& values, bool kernel_holds);

/// Measured by writing a file there for about a second. `needed`: bytes per second.
Finding check_disk_speed(const std::filesystem::path& folder, double needed);
Finding judge_disk_speed(double bytes_per_second, double needed);

/// `mb`: usbcore.usbfs_memory_mb, -1 when there is no USB here. It limits cameras on USB (given by
/// a serial number), of all together.
Finding check_usb_memory(long mb, bool has_usb_cameras);

/// All of them, for the cameras that hang on this PC.
std::vector<Finding> examine_machine(const Studio& studio,
                                     const std::vector<StudioCamera>& cameras);

}  // namespace v3d::ctl
