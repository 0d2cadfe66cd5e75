// Simulated hosts on one network: each is a network namespace with a virtual cable (veth) to a port
// of a switch. A test program that is linked with this runs its tests on the operator's host, in
// new user and network namespaces. The tests are skipped where the system does not permit
// namespaces.
#pragma once

#include <sys/types.h>

#include <memory>
#include <string>
#include <vector>

namespace v3d::test {

/// A process in a new network namespace, which exists until destruction.
class Host {
 public:
  /// Adds a test failure when the namespace cannot be created.
  Host();
  ~Host();
  Host(const Host&) = delete;
  Host& operator=(const Host&) = delete;

  pid_t pid() const { return pid_; }

 private:
  pid_t pid_ = -1;
};

/// Hosts 0 to n - 1, with the addresses of simulated cameras on `lo`, and the operator's host.
class HostNetwork {
 public:
  explicit HostNetwork(size_t hosts);
  ~HostNetwork();
  HostNetwork(const HostNetwork&) = delete;
  HostNetwork& operator=(const HostNetwork&) = delete;

  /// A process in the network namespace of the host.
  pid_t pid(size_t host) const { return hosts_[host]->pid(); }
  /// Prefix of a command that runs on the host.
  std::vector<std::string> enter(size_t host) const;
  /// Interfaces at the switch's ends of the cables, in the order of the hosts; the last one belongs
  /// to the operator's host.
  const std::vector<std::string>& ports() const { return ports_; }

 private:
  void connect_host(size_t i);
  void connect_operator();

  std::vector<std::unique_ptr<Host>> hosts_;
  std::vector<std::string> ports_;
};

}  // namespace v3d::test
