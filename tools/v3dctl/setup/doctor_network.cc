#include <arpa/inet.h>
#include <linux/if_ether.h>
#include <linux/if_packet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstring>
#include <fstream>
#include <map>

#include "base/error.h"
#include "base/lcm_group.h"
#include "base/units.h"
#include "v3dctl/setup/doctor.h"
#include "v3dctl/setup/doctor_key.h"
#include "v3dctl/setup/doctor_machine.h"

namespace v3d::ctl {
namespace {

using Verdict = Finding::Verdict;

constexpr long long kWantedReceiveBuffer = 16 << 20;
constexpr double kLittleDisk = 20e9;

class Socket {
 public:
  Socket(int domain, int type, int protocol) : fd_(socket(domain, type | SOCK_CLOEXEC, protocol)) {}
  ~Socket() {
    if (fd_ >= 0) close(fd_);
  }
  Socket(const Socket&) = delete;
  Socket& operator=(const Socket&) = delete;
  int fd() const { return fd_; }

 private:
  int fd_;
};

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

// GigE Vision control protocol: READREG of register 0 (the version). Every device answers, even one
// that another host controls.
constexpr uint16_t kControlPort = 3956;
constexpr std::array<uint8_t, 12> kReadVersion = {0x42, 0x01, 0x00, 0x80, 0x00, 0x04,
                                                  0x56, 0x33, 0x00, 0x00, 0x00, 0x00};

// Asks all at once; true where an acknowledgement came from the address.
std::map<uint32_t, bool> ask(const std::vector<sockaddr_in>& addresses) {
  std::map<uint32_t, bool> answered;
  const Socket socket(AF_INET, SOCK_DGRAM, 0);
  for (const sockaddr_in& address : addresses) {
    answered[address.sin_addr.s_addr] = false;
    sendto(socket.fd(), kReadVersion.data(), kReadVersion.size(), 0,
           reinterpret_cast<const sockaddr*>(&address), sizeof address);
  }
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(1);
  const auto all = [&] {
    return std::all_of(answered.begin(), answered.end(),
                       [](const auto& entry) { return entry.second; });
  };
  while (!all()) {
    const auto left =
        std::chrono::ceil<std::chrono::milliseconds>(deadline - std::chrono::steady_clock::now());
    pollfd waiting{socket.fd(), POLLIN, 0};
    if (left.count() <= 0 || poll(&waiting, 1, static_cast<int>(left.count())) <= 0) break;
    uint8_t packet[64];
    sockaddr_in from{};
    socklen_t size = sizeof from;
    const ssize_t bytes =
        recvfrom(socket.fd(), packet, sizeof packet, 0, reinterpret_cast<sockaddr*>(&from), &size);
    const bool is_ours = bytes >= 8 && packet[6] == kReadVersion[6] && packet[7] == kReadVersion[7];
    const auto found = answered.find(from.sin_addr.s_addr);
    if (is_ours && found != answered.end()) found->second = true;
  }
  return answered;
}

}  // namespace

Finding check_receive_buffer(long long bytes) {
  if (bytes < 0)
    return {Verdict::kUnknown, "receive buffer", "net.core.rmem_max cannot be read", ""};
  const std::string text = "net.core.rmem_max is " + format_bytes(static_cast<double>(bytes));
  if (bytes >= kWantedReceiveBuffer) return {Verdict::kGood, "receive buffer", text, ""};
  return {Verdict::kBad, "receive buffer", text + ": frames will be lost",
          "sudo sysctl -w net.core.rmem_max=33554432, or install sysctl.d/60-v3d.conf"};
}

Finding check_disk(const std::string& path) {
  struct statvfs disk {};
  if (statvfs(path.c_str(), &disk) != 0) {
    return {Verdict::kBad, "disk", errno_message(path),
            "mkdir -p " + path + ", owned by the user v3d"};
  }
  const double free = static_cast<double>(disk.f_bavail) * static_cast<double>(disk.f_frsize);
  const std::string text = path + " has " + format_bytes(free) + " free";
  if (free >= kLittleDisk) return {Verdict::kGood, "disk", text, ""};
  return {Verdict::kBad, "disk", text, "move takes away: v3dctl takes lists them"};
}

Finding check_multicast(const std::string& lcm_url) {
  const auto group = lcm_group(lcm_url);
  sockaddr_in address{};
  if (!group || !parse_address(group->address, group->port, address)) {
    return {Verdict::kUnknown, "multicast", "no group address in " + lcm_url, ""};
  }
  const Socket socket(AF_INET, SOCK_DGRAM, 0);
  if (connect(socket.fd(), reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0) {
    return {Verdict::kGood, "multicast", group->address + " has a route", ""};
  }
  return {Verdict::kBad, "multicast", errno_message(group->address),
          "sudo ip route add 224.0.0.0/4 dev eth0, with the interface of the studio network"};
}

Finding check_packet_socket() {
  const Socket socket(AF_PACKET, SOCK_DGRAM, htons(ETH_P_IP));
  if (socket.fd() >= 0) return {Verdict::kGood, "packet socket", "may be opened here", ""};
  // The daemon gets the right from its unit; this tool usually has none.
  return {
      Verdict::kUnknown, "packet socket", "not permitted to this user (CAP_NET_RAW)",
      "the unit v3d-captured@.service grants it; by hand: sudo setcap cap_net_raw+ep v3d-captured"};
}

std::vector<Finding> check_cameras(const std::vector<StudioCamera>& cameras) {
  std::vector<sockaddr_in> addresses;
  for (const StudioCamera& camera : cameras) {
    sockaddr_in address{};
    const bool has_address = parse_address(camera.address, kControlPort, address);
    if (camera.kind == CameraKind::kAravis && has_address) addresses.push_back(address);
  }
  const auto answered = ask(addresses);
  std::vector<Finding> findings;
  for (const StudioCamera& camera : cameras) {
    sockaddr_in address{};
    if (camera.kind == CameraKind::kV4l2) {
      const bool there = access(camera.address.c_str(), R_OK | W_OK) == 0;
      findings.push_back({there ? Verdict::kGood : Verdict::kBad, camera.name,
                          errno_message(camera.address),
                          there ? "" : "check the cable, and that the user is in group video"});
      if (there) findings.back().text = camera.address + " can be opened";
    } else if (!parse_address(camera.address, kControlPort, address)) {
      findings.push_back({Verdict::kUnknown, camera.name,
                          "given by serial number " + camera.address,
                          "arv-tool-0.8 lists the cameras that this PC sees"});
    } else if (answered.at(address.sin_addr.s_addr)) {
      findings.push_back({Verdict::kGood, camera.name, camera.address + " answers", ""});
    } else {
      findings.push_back(
          {Verdict::kBad, camera.name, camera.address + " does not answer",
           "check its power and cable, and that this PC has an address in its subnet"});
    }
  }
  return findings;
}

std::vector<Finding> examine(const Studio& studio, const std::string& node) {
  std::vector<Finding> findings = {check_receive_buffer(read_rmem_max()),
                                   check_multicast(studio.network.lcm_url), check_packet_socket(),
                                   check_disk(studio.storage.takes)};
  for (const std::string& url : studio.network.frame_groups) {
    findings.push_back(check_multicast(url));
  }
  const std::vector<StudioCamera> cameras = node.empty() ? studio.cameras : studio.cameras_of(node);
  for (const auto& more :
       {examine_machine(studio, cameras), check_cameras(cameras), examine_keys(studio)}) {
    findings.insert(findings.end(), more.begin(), more.end());
  }
  return findings;
}

}  // namespace v3d::ctl
