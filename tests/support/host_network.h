// Hosts on one network: each is a network namespace with a cable to a port of a switch. A program
// that is linked with this runs its tests on the operator's host, in user and network namespaces of
// its own; they are skipped where none can be had.
#pragma once

#include <sys/types.h>

#include <memory>
#include <string>
#include <vector>

namespace v3d::test {

/// A network namespace of its own, as long as it lives.
class Host {
 public:
  /// Adds a failure to the test where that is not possible.
  Host();
  ~Host();
  Host(const Host&) = delete;
  Host& operator=(const Host&) = delete;

  pid_t pid() const { return pid_; }

 private:
  pid_t pid_ = -1;
};

/// Hosts 0 to n - 1, with the addresses of simulated cameras on `lo`, and the operator's.
class HostNetwork {
 public:
  explicit HostNetwork(size_t hosts);
  ~HostNetwork();
  HostNetwork(const HostNetwork&) = delete;
  HostNetwork& operator=(const HostNetwork&) = delete;

  /// Of a process whose network is the host's.
  pid_t pid(size_t host) const { return hosts_[host]->pid(); }
  /// In front of a command that shall run there.
  std::vector<std::string> enter(size_t host) const;
  /// The other ends of the cables, in the order of the hosts; the last is the operator's.
  const std::vector<std::string>& ports() const { return ports_; }

 private:
  void lay_cable(size_t i);
  void lay_operators_cable();

  std::vector<std::unique_ptr<Host>> hosts_;
  std::vector<std::string> ports_;
};

}  // namespace v3d::test
