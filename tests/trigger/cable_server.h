// Test server of the simulated trigger cable: records every edge and echoes it to every client.
#pragma once

#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <condition_variable>
#include <cstring>
#include <filesystem>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "base/config/studio_values.h"
#include "support/temporary_folder.h"

namespace v3d::trigger {

class CableServer {
 public:
  CableServer() {
    listen_ = socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0);
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    std::strncpy(address.sun_path, path_.c_str(), sizeof(address.sun_path) - 1);
    bind(listen_, reinterpret_cast<sockaddr*>(&address), sizeof(address));
    listen(listen_, 8);
    thread_ = std::thread([this] { serve(); });
  }
  ~CableServer() { vanish(); }

  /// Closes all connections and removes the socket, as after a crash of the simulated studio.
  void vanish() {
    if (!thread_.joinable()) return;
    const uint64_t one = 1;
    [[maybe_unused]] const auto n = write(quit_, &one, sizeof(one));
    thread_.join();
    for (int fd : clients_) close(fd);
    close(listen_);
    close(quit_);
    std::filesystem::remove(path_);
  }

  const std::filesystem::path& path() const { return path_; }

  std::vector<int64_t> edges() const {
    const std::lock_guard lock(mutex_);
    return edges_;
  }
  /// Both return false when the number is not reached within 10 s.
  bool wait_for_edges(size_t count) {
    std::unique_lock lock(mutex_);
    return changed_.wait_for(lock, std::chrono::seconds(10),
                             [&] { return edges_.size() >= count; });
  }
  bool wait_for_clients(size_t count) {
    std::unique_lock lock(mutex_);
    return changed_.wait_for(lock, std::chrono::seconds(10), [&] { return accepted_ >= count; });
  }
  /// Sends a packet that is not an edge, or an edge of interference.
  void send_to_all(const std::string& bytes) {
    const std::lock_guard lock(mutex_);
    for (int fd : clients_) send(fd, bytes.data(), bytes.size(), MSG_NOSIGNAL);
  }

 private:
  void serve() {
    for (;;) {
      std::vector<pollfd> fds{{quit_, POLLIN, 0}, {listen_, POLLIN, 0}};
      for (int fd : clients_) fds.push_back({fd, POLLIN, 0});
      poll(fds.data(), fds.size(), -1);
      if (fds[0].revents) return;
      const std::lock_guard lock(mutex_);
      for (size_t i = 2; i < fds.size(); ++i) {
        if (fds[i].revents) read_from(fds[i].fd);
      }
      if (fds[1].revents) {
        clients_.push_back(accept(listen_, nullptr, nullptr));
        ++accepted_;
      }
      changed_.notify_all();
    }
  }

  void read_from(int fd) {
    TriggerEdge edge;
    if (recv(fd, &edge, sizeof(edge), 0) != sizeof(edge)) {
      close(fd);
      clients_.erase(std::find(clients_.begin(), clients_.end(), fd));
      return;
    }
    edges_.push_back(edge.edge_monotonic_ns);
    for (int client : clients_) send(client, &edge, sizeof(edge), MSG_NOSIGNAL | MSG_DONTWAIT);
  }

  const test::TemporaryFolder folder_;
  const std::filesystem::path path_ = folder_ / "cable";
  int listen_ = -1;
  int quit_ = eventfd(0, EFD_CLOEXEC);
  std::thread thread_;
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<int> clients_;
  std::vector<int64_t> edges_;
  size_t accepted_ = 0;
};

}  // namespace v3d::trigger
