// Private namespaces for tests. A program that is linked with this runs its tests in new user,
// network and mount namespaces, where `lo` has a multicast route and the addresses of simulated
// cameras. Messages and mounts do not reach the host, and test programs can run in parallel. The
// tests are skipped where the system does not permit namespaces.
#include <gtest/gtest.h>
#include <sched.h>
#include <unistd.h>

#include <cstdlib>
#include <fstream>

#include "base/core/error.h"
#include "support/priority.h"

namespace v3d::test {
namespace {

/// Moves this process and its later children into new namespaces, before any thread starts. Returns
/// an empty string, or the error.
std::string enter_namespaces() {
  const uid_t user = getuid();
  const gid_t group = getgid();
  use_hardware_priority();
  if (unshare(CLONE_NEWUSER | CLONE_NEWNET | CLONE_NEWNS) != 0) return errno_message("unshare");
  std::ofstream("/proc/self/setgroups") << "deny";
  std::ofstream("/proc/self/uid_map") << "0 " << user << " 1";
  std::ofstream("/proc/self/gid_map") << "0 " << group << " 1";
  const char* commands =
      "ip link set lo up mtu 65536 && ip link set lo multicast on && "
      "ip route add 224.0.0.0/4 dev lo && "
      "for i in $(seq 11 25); do ip addr add 127.0.0.$i/32 dev lo || exit 1; done";
  return std::system(commands) == 0 ? "" : "ip failed";
}

class OwnNetwork : public testing::Environment {
 public:
  void SetUp() override {
    const std::string problem = enter_namespaces();
    if (!problem.empty()) GTEST_SKIP() << "skipped: no network namespace here: " << problem;
  }
};
[[maybe_unused]] const auto* const kOwnNetwork = testing::AddGlobalTestEnvironment(new OwnNetwork);

}  // namespace
}  // namespace v3d::test
