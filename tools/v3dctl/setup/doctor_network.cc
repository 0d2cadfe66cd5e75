#include <arpa/inet.h>
#include <ifaddrs.h>
#include <linux/if_ether.h>
#include <linux/if_packet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstring>
#include <fstream>
#include <map>
#include <memory>
#include <set>

#include "base/config/studio_values.h"
#include "base/config/toml_file.h"
#include "base/config/v4l2_address.h"
#include "base/core/error.h"
#include "base/core/text.h"
#include "base/io/unique_fd.h"
#include "v3dctl/setup/doctor.h"

namespace v3d::ctl {
namespace {

using Verdict = Finding::Verdict;

constexpr long long kMinReceiveBuffer = 16 << 20;  // a burst of frames of 15 XGA cameras

io::UniqueFd open_socket(int domain, int type, int protocol) {
  return io::UniqueFd(socket(domain, type | SOCK_CLOEXEC, protocol));
}

bool parse_address(const std::string& text, uint16_t port, sockaddr_in& address) {
  address = {};
  address.sin_family = AF_INET;
  address.sin_port = htons(port);
  return inet_pton(AF_INET, text.c_str(), &address.sin_addr) == 1;
}

long long read_rmem_max() {
  long long bytes = -1;
  std::ifstream("/proc/sys/net/core/rmem_max") >> bytes;
  return bytes;
}

// GigE Vision control protocol: READREG of register 0 (the version). A device replies also when
// another host controls it.
constexpr uint16_t kControlPort = 3956;
constexpr std::array<uint8_t, 12> kReadVersion = {0x42, 0x01, 0x00, 0x80, 0x00, 0x04,
                                                  0x56, 0x33, 0x00, 0x00, 0x00, 0x00};

/// Sends a register read to all addresses and waits up to 1 s. Result: whether each address
/// replied.
std::map<uint32_t, bool> read_versions(const std::vector<sockaddr_in>& addresses) {
  std::map<uint32_t, bool> replied;
  const io::UniqueFd socket = open_socket(AF_INET, SOCK_DGRAM, 0);
  for (const sockaddr_in& address : addresses) {
    replied[address.sin_addr.s_addr] = false;
    sendto(socket.get(), kReadVersion.data(), kReadVersion.size(), 0,
           reinterpret_cast<const sockaddr*>(&address), sizeof address);
  }
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(1);
  const auto all = [&] {
    return std::all_of(replied.begin(), replied.end(),
                       [](const auto& entry) { return entry.second; });
  };
  while (!all()) {
    const auto remaining =
        std::chrono::ceil<std::chrono::milliseconds>(deadline - std::chrono::steady_clock::now());
    pollfd waiting{socket.get(), POLLIN, 0};
    if (remaining.count() <= 0 || poll(&waiting, 1, static_cast<int>(remaining.count())) <= 0)
      break;
    uint8_t packet[64];
    sockaddr_in from{};
    socklen_t size = sizeof from;
    const ssize_t bytes =
        recvfrom(socket.get(), packet, sizeof packet, 0, reinterpret_cast<sockaddr*>(&from), &size);
    const bool is_reply =
        bytes >= 8 && packet[6] == kReadVersion[6] && packet[7] == kReadVersion[7];
    const auto found = replied.find(from.sin_addr.s_addr);
    if (is_reply && found != replied.end()) found->second = true;
  }
  return replied;
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

long read_mtu(const std::string& interface) {
  long mtu = -1;
  std::ifstream("/sys/class/net/" + interface + "/mtu") >> mtu;
  return mtu;
}

}  // namespace

uint32_t source_address_to(const std::string& address) {
  sockaddr_in to{};
  to.sin_family = AF_INET;
  to.sin_port = htons(kControlPort);
  if (inet_pton(AF_INET, address.c_str(), &to.sin_addr) != 1) return 0;
  const io::UniqueFd socket = open_socket(AF_INET, SOCK_DGRAM, 0);
  sockaddr_in from{};
  socklen_t size = sizeof from;
  const bool known =
      connect(socket.get(), reinterpret_cast<const sockaddr*>(&to), sizeof to) == 0 &&
      getsockname(socket.get(), reinterpret_cast<sockaddr*>(&from), &size) == 0;
  return known ? from.sin_addr.s_addr : 0;
}

Finding check_receive_buffer(long long bytes) {
  if (bytes < 0)
    return {Verdict::kUnknown, "receive buffer", "net.core.rmem_max cannot be read", ""};
  const std::string text = "net.core.rmem_max is " + format_bytes(static_cast<double>(bytes));
  if (bytes >= kMinReceiveBuffer) return {Verdict::kGood, "receive buffer", text, ""};
  return {Verdict::kBad, "receive buffer", text + ": frames will be lost",
          "as root: sysctl -w net.core.rmem_max=33554432, or install sysctl.d/60-v3d.conf"};
}

Finding check_multicast(const std::string& lcm_url) {
  const auto group = lcm_group(lcm_url);
  sockaddr_in address{};
  if (!group || !parse_address(group->address, group->port, address)) {
    return {Verdict::kUnknown, "multicast", "no group address in " + lcm_url, ""};
  }
  const io::UniqueFd socket = open_socket(AF_INET, SOCK_DGRAM, 0);
  if (connect(socket.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0) {
    return {Verdict::kGood, "multicast", group->address + " has a route", ""};
  }
  return {Verdict::kBad, "multicast", errno_message(group->address),
          "as root: ip route add 224.0.0.0/4 dev eth0, with the interface of the studio network"};
}

Finding check_packet_socket() {
  const io::UniqueFd socket = open_socket(AF_PACKET, SOCK_DGRAM, htons(ETH_P_IP));
  if (socket) return {Verdict::kGood, "packet socket", "this user may open one", ""};
  // The unit of the daemon grants the permission; users usually do not have it.
  return {Verdict::kUnknown, "packet socket", "not permitted to this user (CAP_NET_RAW)",
          "the unit v3d-captured@.service grants it; by hand, as root: setcap cap_net_raw+ep "
          "v3d-captured"};
}

namespace {

Finding check_v4l2(const StudioCamera& camera) {
  try {
    const std::string path = v4l2_device(camera);
    if (access(path.c_str(), R_OK | W_OK) == 0) {
      return {Verdict::kGood, camera.name, path + " can be opened", ""};
    }
    return {Verdict::kBad, camera.name, errno_message(path),
            "check the cable, and that the user is in group video"};
  } catch (const InputError& error) {
    return {Verdict::kBad, camera.name, error.what(),
            "check the cable; ls -l /dev/v4l/by-id /dev/v4l/by-path lists the cameras"};
  }
}

}  // namespace

std::vector<Finding> check_cameras(const std::vector<StudioCamera>& cameras) {
  std::vector<sockaddr_in> addresses;
  for (const StudioCamera& camera : cameras) {
    sockaddr_in address{};
    const bool has_address = parse_address(camera.address, kControlPort, address);
    if (camera.kind == CameraKind::kAravis && has_address) addresses.push_back(address);
  }
  const auto replied = read_versions(addresses);
  std::vector<Finding> findings;
  for (const StudioCamera& camera : cameras) {
    sockaddr_in address{};
    if (camera.kind == CameraKind::kV4l2) {
      findings.push_back(check_v4l2(camera));
    } else if (!parse_address(camera.address, kControlPort, address)) {
      findings.push_back({Verdict::kUnknown, camera.name,
                          "has a serial number, " + camera.address + ", and no address",
                          "arv-tool-0.8 lists the cameras that this PC sees"});
    } else if (replied.at(address.sin_addr.s_addr)) {
      findings.push_back({Verdict::kGood, camera.name, camera.address + " replies", ""});
    } else {
      findings.push_back(
          {Verdict::kBad, camera.name, camera.address + " does not reply",
           "check its power and cable, and that this PC has an address in its subnet"});
    }
  }
  return findings;
}

namespace {

/// One finding for each camera in the file.
std::vector<Finding> read_camera_settings(const std::filesystem::path& path) {
  std::map<std::string, std::string> ignored;  // by camera
  const TomlTable file = TomlTable::load(path);
  for (const TomlTable& difference : file.tables("difference")) {
    if (difference.boolean_or("rounded", false)) continue;
    std::string& text = ignored[difference.text("camera")];
    text += (text.empty() ? "" : ", ") + difference.text("setting") + " (expected " +
            difference.text("asked") + ", found " + difference.text("got") + ")";
  }
  std::vector<Finding> findings;
  for (const TomlTable& camera : file.tables("camera")) {
    const std::string name = camera.text("name");
    const std::string& settings = ignored[name];
    const std::string device = camera.text_or("device", "");
    findings.push_back({settings.empty() ? Verdict::kGood : Verdict::kBad, name,
                        device + (settings.empty() ? "; all settings as in the studio file"
                                                   : "; ignores settings: " + settings),
                        settings.empty() ? "" : "correct the studio file, or the camera"});
  }
  return findings;
}

}  // namespace

std::vector<Finding> check_camera_settings(const Studio& studio,
                                           const std::vector<StudioCamera>& cameras) {
  std::set<std::string> nodes;
  for (const StudioCamera& camera : cameras) nodes.insert(camera.node);
  std::vector<Finding> findings;
  for (const std::string& node : nodes) {
    const auto path = studio.storage.takes / (".camera-settings-" + node + ".toml");
    std::error_code error;
    if (!std::filesystem::exists(path, error)) continue;
    try {
      const auto more = read_camera_settings(path);
      findings.insert(findings.end(), more.begin(), more.end());
    } catch (const InputError& damaged) {
      findings.push_back({Verdict::kUnknown, node, damaged.what(), "restart v3d-captured@" + node});
    }
  }
  return findings;
}

Finding check_mtu(const std::string& interface, int mtu, int packet_size) {
  const std::string text = interface + " sends packets of up to " + std::to_string(mtu) + " bytes";
  if (mtu >= packet_size) return {Verdict::kGood, "MTU", text, ""};
  return {Verdict::kBad, "MTU", text + "; its cameras send " + std::to_string(packet_size),
          "as root: ip link set dev " + interface + " mtu " + std::to_string(packet_size) +
              " (and on the switch), or packet_size = " + std::to_string(mtu) +
              " in the studio file"};
}

std::vector<Finding> check_mtu(const std::vector<StudioCamera>& cameras) {
  std::map<std::string, int> packet_sizes;  // largest of each interface
  for (const StudioCamera& camera : cameras) {
    if (camera.kind != CameraKind::kAravis) continue;
    const std::string interface = interface_with(source_address_to(camera.address));
    if (interface.empty()) continue;  // a serial number, or no route, which check_cameras() reports
    packet_sizes[interface] = std::max(packet_sizes[interface], camera.packet_size);
  }
  std::vector<Finding> findings;
  for (const auto& [interface, packet_size] : packet_sizes) {
    const long mtu = read_mtu(interface);
    findings.push_back(check_mtu(interface, static_cast<int>(mtu), packet_size));
  }
  return findings;
}

std::vector<Finding> check_network(const Studio& studio, const std::vector<StudioCamera>& cameras) {
  std::vector<Finding> findings = {check_receive_buffer(read_rmem_max()),
                                   check_multicast(studio.network.lcm_url), check_packet_socket()};
  for (const std::string& url : studio.network.frame_groups) {
    findings.push_back(check_multicast(url));
  }
  for (const auto& more :
       {check_mtu(cameras), check_cameras(cameras), check_camera_settings(studio, cameras)}) {
    findings.insert(findings.end(), more.begin(), more.end());
  }
  return findings;
}

}  // namespace v3d::ctl
