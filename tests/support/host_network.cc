#include "support/host_network.h"

#include <gtest/gtest.h>
#include <sched.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <cstdlib>
#include <fstream>

#include "support/priority.h"

namespace v3d::test {
namespace {

constexpr char kLink[] = " mtu 65535 multicast on up";
constexpr char kPair[] = " mtu 65535 type veth peer name ";

std::string run(const std::string& command) {
  return std::system((command + " >/dev/null 2>&1").c_str()) == 0 ? "" : command + " failed";
}

/// Moves this process into the namespaces of the operator's host, before any thread starts.
class OperatorsHost : public testing::Environment {
 public:
  void SetUp() override {
    const uid_t user = getuid();
    const gid_t group = getgid();
    use_hardware_priority();
    if (unshare(CLONE_NEWUSER | CLONE_NEWNET) != 0) GTEST_SKIP() << "no network namespace here";
    std::ofstream("/proc/self/setgroups") << "deny";
    std::ofstream("/proc/self/uid_map") << "0 " << user << " 1";
    std::ofstream("/proc/self/gid_map") << "0 " << group << " 1";
    ASSERT_EQ(run("ip link set lo up"), "");
  }
};
[[maybe_unused]] const auto* const kOperatorsHost =
    testing::AddGlobalTestEnvironment(new OperatorsHost);

}  // namespace

Host::Host() {
  int ready[2];
  if (pipe(ready) != 0) std::abort();
  pid_ = fork();
  if (pid_ == 0) {
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    if (unshare(CLONE_NEWNET) == 0 && write(ready[1], "", 1) == 1) {
      while (true) pause();
    }
    _exit(1);
  }
  close(ready[1]);
  char byte = 0;
  if (read(ready[0], &byte, 1) != 1) ADD_FAILURE() << "no network namespace";
  close(ready[0]);
}

Host::~Host() {
  kill(pid_, SIGKILL);
  waitpid(pid_, nullptr, 0);
}

HostNetwork::HostNetwork(size_t hosts) {
  for (size_t i = 0; i < hosts; ++i) connect_host(i);
  connect_operator();
}

/// Removing one end of a cable removes the cable. The next test creates its own.
HostNetwork::~HostNetwork() {
  for (const std::string& port : ports_) run("ip link del " + port);
}

std::vector<std::string> HostNetwork::enter(size_t host) const {
  return {"/usr/bin/nsenter", "--net=/proc/" + std::to_string(pid(host)) + "/ns/net"};
}

void HostNetwork::connect_host(size_t i) {
  const std::string number = std::to_string(i);
  const std::string host = "h" + number, port = "sw" + number;
  const std::string pid = std::to_string(hosts_.emplace_back(std::make_unique<Host>())->pid());
  EXPECT_EQ(run("ip link add " + host + kPair + port + " && ip link set " + host + " netns " + pid +
                " && ip link set " + port + kLink),
            "");
  EXPECT_EQ(run("nsenter --net=/proc/" + pid + "/ns/net sh -c 'ip addr add 10.7.0." +
                std::to_string(i + 1) + "/24 dev " + host + " && ip link set " + host + kLink +
                " && ip route add 224.0.0.0/4 dev " + host + " && ip link set lo up mtu 65536 && " +
                "for i in $(seq 11 25); do ip addr add 127.0.0.$i/32 dev lo; done'"),
            "");
  ports_.push_back(port);
}

void HostNetwork::connect_operator() {
  EXPECT_EQ(run("ip link add desk" + std::string(kPair) + "swdesk && ip link set swdesk" + kLink +
                " && ip addr add 10.7.0.99/24 dev desk && ip link set desk" + kLink +
                " && ip route add 224.0.0.0/4 dev desk"),
            "");
  ports_.push_back("swdesk");
}

}  // namespace v3d::test
