#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <cstring>
#include <mutex>

#include "base/core/error.h"
#include "base/core/trigger_edge.h"
#include "sim/cameras/trigger_cable.h"
#include "support/temporary_folder.h"

namespace v3d::sim {
namespace {

using test::TemporaryFolder;

constexpr int kDeadlineMs = 10'000;

/// One end of the cable, as a generator or a sense line has it.
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
  /// The time of the next echo; -1 when none comes.
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

struct Seen {
  std::mutex mutex;
  std::vector<std::pair<int64_t, int64_t>> edges;
  TriggerCable::OnEdge handler() {
    return [this](int64_t edge, MonotonicInstant time) {
      const std::lock_guard lock(mutex);
      edges.emplace_back(edge, to_ns(time));
    };
  }
};

TEST(TriggerCable, exposes_at_every_edge_and_echoes_it_to_every_client) {
  const TemporaryFolder folder;
  Seen seen;
  const TriggerCable cable(folder / "wire", seen.handler());
  const Client generator(folder / "wire");
  const Client sensor(folder / "wire");
  ASSERT_TRUE(generator.connected() && sensor.connected());
  for (int64_t i = 0; i < 50; ++i) {
    generator.send(1000 + i);
    EXPECT_EQ(sensor.receive(), 1000 + i);
    EXPECT_EQ(generator.receive(), 1000 + i);
  }
  EXPECT_EQ(cable.edges(), 50);
  const std::lock_guard lock(seen.mutex);
  ASSERT_EQ(seen.edges.size(), 50U);
  for (int64_t i = 0; i < 50; ++i) {
    EXPECT_EQ(seen.edges[static_cast<size_t>(i)], std::pair(i, 1000 + i));
  }
}

TEST(TriggerCable, ignores_packets_that_are_no_edge) {
  const TemporaryFolder folder;
  Seen seen;
  const TriggerCable cable(folder / "wire", seen.handler());
  const Client client(folder / "wire");
  client.send("short", 5);
  client.send("far too long for an edge", 24);
  client.send(7);
  EXPECT_EQ(client.receive(), 7);
  EXPECT_EQ(cable.malformed(), 2);
  EXPECT_EQ(cable.edges(), 1);
}

TEST(TriggerCable, outlives_clients_that_go) {
  const TemporaryFolder folder;
  Seen seen;
  const TriggerCable cable(folder / "wire", seen.handler());
  for (int64_t i = 0; i < 5; ++i) {
    const Client client(folder / "wire");
    client.send(i);
    EXPECT_EQ(client.receive(), i);
  }
  EXPECT_EQ(cable.edges(), 5);
}

TEST(TriggerCable, is_not_held_up_by_a_client_that_never_reads) {
  const TemporaryFolder folder;
  Seen seen;
  const TriggerCable cable(folder / "wire", seen.handler());
  const Client deaf(folder / "wire");
  const Client generator(folder / "wire");
  for (int64_t i = 0; i < 5000; ++i) {
    generator.send(i);
    ASSERT_EQ(generator.receive(), i);
  }
  EXPECT_EQ(cable.edges(), 5000);
}

TEST(TriggerCable, replaces_a_dead_socket_but_not_a_living_one) {
  const TemporaryFolder folder;
  Seen seen;
  {
    // A studio that died leaves its socket file behind.
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    std::strncpy(address.sun_path, (folder / "wire").c_str(), sizeof address.sun_path - 1);
    const int dead = ::socket(AF_UNIX, SOCK_SEQPACKET, 0);
    ASSERT_EQ(::bind(dead, reinterpret_cast<sockaddr*>(&address), sizeof address), 0);
    ::close(dead);
  }
  const TriggerCable cable(folder / "wire", seen.handler());
  EXPECT_THROW(TriggerCable(folder / "wire", seen.handler()), InputError);
  EXPECT_TRUE(Client(folder / "wire").connected());
}

TEST(TriggerCable, refuses_a_path_that_no_socket_can_have) {
  const TemporaryFolder folder;
  EXPECT_THROW(TriggerCable(folder / std::string(120, 'x'), nullptr), InputError);
  EXPECT_THROW(TriggerCable(folder / "absent/wire", nullptr), InputError);
}

TEST(TriggerCable, removes_its_socket_in_the_end) {
  const TemporaryFolder folder;
  {
    const TriggerCable cable(folder / "wire", [](int64_t, MonotonicInstant) {});
  }
  EXPECT_FALSE(std::filesystem::exists(folder / "wire"));
}

}  // namespace
}  // namespace v3d::sim
