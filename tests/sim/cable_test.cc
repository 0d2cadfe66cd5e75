#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <cstring>
#include <mutex>

#include "base/config/studio_values.h"
#include "base/core/error.h"
#include "sim/cameras/triggers.h"
#include "support/temporary_folder.h"

namespace v3d::sim {
namespace {

using test::TemporaryFolder;

constexpr int kDeadlineMs = 10'000;

/// A client of the cable, like a generator or a sense line.
class Client {
 public:
  explicit Client(const std::filesystem::path& path)
      : socket_(::socket(AF_UNIX, SOCK_SEQPACKET, 0)) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    std::strncpy(address.sun_path, path.c_str(), sizeof address.sun_path - 1);
    connected_ = ::connect(socket_, reinterpret_cast<sockaddr*>(&address), sizeof address) == 0;
  }
  ~Client() { ::close(socket_); }
  Client(const Client&) = delete;
  Client& operator=(const Client&) = delete;

  bool connected() const { return connected_; }
  void send(const void* bytes, size_t size) const {
    ASSERT_EQ(::send(socket_, bytes, size, MSG_NOSIGNAL), static_cast<ssize_t>(size));
  }
  void send(int64_t monotonic_ns) const {
    const TriggerEdge edge{monotonic_ns};
    send(&edge, sizeof edge);
  }
  /// The time of the next echo; -1 when none comes within the deadline.
  int64_t receive() const {
    pollfd readable{socket_, POLLIN, 0};
    TriggerEdge edge{-1};
    if (::poll(&readable, 1, kDeadlineMs) == 1 &&
        ::recv(socket_, &edge, sizeof edge, 0) != sizeof edge) {
      return -1;
    }
    return edge.edge_monotonic_ns;
  }

 private:
  int socket_;
  bool connected_ = false;
};

/// Records the edges that the cable reports.
struct EdgeRecord {
  std::mutex mutex;
  std::vector<std::pair<int64_t, int64_t>> edges;
  TriggerCable::OnEdge handler() {
    return [this](int64_t edge, MonotonicInstant time) {
      const std::lock_guard lock(mutex);
      edges.emplace_back(edge, to_ns(time));
    };
  }
};

TEST(TriggerCable, reports_every_edge_and_echoes_it_to_every_client) {
  const TemporaryFolder folder;
  EdgeRecord record;
  const TriggerCable cable(folder / "wire", record.handler());
  const Client generator(folder / "wire");
  const Client sensor(folder / "wire");
  ASSERT_TRUE(generator.connected() && sensor.connected());
  for (int64_t i = 0; i < 50; ++i) {
    generator.send(1000 + i);
    EXPECT_EQ(sensor.receive(), 1000 + i);
    EXPECT_EQ(generator.receive(), 1000 + i);
  }
  EXPECT_EQ(cable.edges(), 50);
  const std::lock_guard lock(record.mutex);
  ASSERT_EQ(record.edges.size(), 50U);
  for (int64_t i = 0; i < 50; ++i) {
    EXPECT_EQ(record.edges[static_cast<size_t>(i)], std::pair(i, 1000 + i));
  }
}

TEST(TriggerCable, ignores_packets_that_are_not_edges) {
  const TemporaryFolder folder;
  EdgeRecord record;
  const TriggerCable cable(folder / "wire", record.handler());
  const Client client(folder / "wire");
  client.send("short", 5);
  client.send("far too long for an edge", 24);
  client.send(7);
  EXPECT_EQ(client.receive(), 7);
  EXPECT_EQ(cable.malformed(), 2);
  EXPECT_EQ(cable.edges(), 1);
}

TEST(TriggerCable, works_after_clients_disconnect) {
  const TemporaryFolder folder;
  EdgeRecord record;
  const TriggerCable cable(folder / "wire", record.handler());
  for (int64_t i = 0; i < 5; ++i) {
    const Client client(folder / "wire");
    client.send(i);
    EXPECT_EQ(client.receive(), i);
  }
  EXPECT_EQ(cable.edges(), 5);
}

TEST(TriggerCable, is_not_blocked_by_a_client_that_never_reads) {
  const TemporaryFolder folder;
  EdgeRecord record;
  const TriggerCable cable(folder / "wire", record.handler());
  const Client silent(folder / "wire");
  const Client generator(folder / "wire");
  for (int64_t i = 0; i < 5000; ++i) {
    generator.send(i);
    ASSERT_EQ(generator.receive(), i);
  }
  EXPECT_EQ(cable.edges(), 5000);
}

TEST(TriggerCable, replaces_an_unused_socket_file_but_not_a_used_one) {
  const TemporaryFolder folder;
  EdgeRecord record;
  {
    // A socket file without a server, as after a crash of a studio.
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    std::strncpy(address.sun_path, (folder / "wire").c_str(), sizeof address.sun_path - 1);
    const int dead = ::socket(AF_UNIX, SOCK_SEQPACKET, 0);
    ASSERT_EQ(::bind(dead, reinterpret_cast<sockaddr*>(&address), sizeof address), 0);
    ::close(dead);
  }
  const TriggerCable cable(folder / "wire", record.handler());
  EXPECT_THROW(TriggerCable(folder / "wire", record.handler()), InputError);
  EXPECT_TRUE(Client(folder / "wire").connected());
}

TEST(TriggerCable, rejects_paths_that_are_too_long_or_in_a_missing_folder) {
  const TemporaryFolder folder;
  EXPECT_THROW(TriggerCable(folder / std::string(120, 'x'), nullptr), InputError);
  EXPECT_THROW(TriggerCable(folder / "absent/wire", nullptr), InputError);
}

TEST(TriggerCable, removes_its_socket_file_in_the_destructor) {
  const TemporaryFolder folder;
  {
    const TriggerCable cable(folder / "wire", [](int64_t, MonotonicInstant) {});
  }
  EXPECT_FALSE(std::filesystem::exists(folder / "wire"));
}

}  // namespace
}  // namespace v3d::sim
