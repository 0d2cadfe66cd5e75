// The web server over loopback: connection limits, request timeouts, and slow disks. Clients use
// several addresses of 127.0.0.0/8.
#include "daemon/web/web_server.h"

#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/socket.h>

#include <algorithm>
#include <atomic>
#include <future>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "base/core/error.h"
#include "base/io/unique_fd.h"
#include "daemon/web/connection_slots.h"
#include "support/child_process.h"
#include "viewed_site.h"

namespace v3d::viewd {
namespace {

using test::becomes_true;
using test::within;
using testing::HasSubstr;
using testing::StartsWith;

constexpr const char* kToken = "operators-0123456789";

/// A TCP connection from one loopback address to the server.
class Client {
 public:
  /// `receive_bytes`: size of its receive buffer in the kernel; 0: the system's default.
  explicit Client(uint16_t port, const std::string& from = "127.0.0.1", int receive_bytes = 0)
      : fd_(socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    if (receive_bytes > 0) {
      setsockopt(fd_.get(), SOL_SOCKET, SO_RCVBUF, &receive_bytes, sizeof receive_bytes);
    }
    const sockaddr_in here = endpoint(from, 0);
    const sockaddr_in there = endpoint("127.0.0.1", port);
    EXPECT_EQ(bind(fd_.get(), reinterpret_cast<const sockaddr*>(&here), sizeof here), 0);
    EXPECT_EQ(connect(fd_.get(), reinterpret_cast<const sockaddr*>(&there), sizeof there), 0);
  }
  Client& write(const std::string& bytes) {
    send(fd_.get(), bytes.data(), bytes.size(), MSG_NOSIGNAL);
    return *this;
  }
  /// All received text.
  const std::string& text() {
    pollfd ready{fd_.get(), POLLIN, 0};
    char part[4096];
    while (!ended_ && poll(&ready, 1, 0) > 0) {
      const ssize_t got = recv(fd_.get(), part, sizeof part, 0);
      ended_ = got <= 0;
      if (!ended_) text_.append(part, static_cast<size_t>(got));
    }
    return text_;
  }
  bool has_ended() {
    text();
    return ended_;
  }
  bool receives(const std::string& what, int seconds = 20) {
    return becomes_true([&] { return text().find(what) != std::string::npos; }, within(seconds));
  }

 private:
  static sockaddr_in endpoint(const std::string& address, uint16_t port) {
    sockaddr_in made{};
    made.sin_family = AF_INET;
    made.sin_port = htons(port);
    inet_pton(AF_INET, address.c_str(), &made.sin_addr);
    return made;
  }
  io::UniqueFd fd_;
  std::string text_;
  bool ended_ = false;
};

std::string request(const std::string& target, const std::string& fields = "") {
  return "GET " + target + " HTTP/1.1\r\nHost: 127.0.0.1\r\n" + fields + "\r\n";
}
const std::string kUpgrade =
    "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
    "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n";

class Silent : public web::WebStream {
 public:
  std::optional<web::WebMessage> next() override { return {}; }
};

/// Always has a next message, up to kMessages. Counts those that the server has taken.
class Torrent : public web::WebStream {
 public:
  static constexpr int kMessages = 4000;
  static constexpr size_t kMessageBytes = 64 << 10;

  explicit Torrent(std::shared_ptr<std::atomic<int>> taken) : taken_(std::move(taken)) {}
  std::optional<web::WebMessage> next() override {
    if (*taken_ == kMessages) return {};
    ++*taken_;
    return web::WebMessage{.is_text = false, .bytes = bytes_};
  }

 private:
  const std::shared_ptr<std::atomic<int>> taken_;
  const std::shared_ptr<const std::string> bytes_ =
      std::make_shared<const std::string>(kMessageBytes, 'x');
};

class ServedSite : public test::ViewedSite {
 protected:
  ServedSite() {
    studio_.viewer.control = true;
    serve({});
  }
  void serve(const web::WebLimits& limits) {
    server_.reset();
    site_.emplace(studio_, web::WebAccess(""), find_page_files(folder_ / "page"), operators_,
                  [this, list = WebSite::make_list_takes()](const std::filesystem::path& folder) {
                    ++listings_;
                    disk_.wait();
                    return list(folder);
                  });
    handler_.emplace(*site_, [this](WebSite::StreamKind) { return stream(); });
    server_ = std::make_unique<web::WebServer>(web::WebAddress{"127.0.0.1", 0}, *handler_, limits);
  }
  ~ServedSite() override { wake_disk(); }
  virtual std::unique_ptr<web::WebStream> stream() { return std::make_unique<Silent>(); }
  void wake_disk() {
    if (!std::exchange(disk_is_awake_, true)) disk_sleeps_.set_value();
  }

  std::unique_ptr<Client> client(const std::string& from = "127.0.0.1") const {
    return std::make_unique<Client>(server_->port(), from);
  }
  /// `count` connections of the address that have sent `bytes`.
  void occupy(int count, const std::string& from, const std::string& bytes) {
    for (int i = 0; i < count; ++i) {
      clients_.push_back(client(from));
      clients_.back()->write(bytes);
    }
  }
  bool gets_page(const std::string& from = "127.0.0.1") const {
    return client(from)->write(request("/")).receives("<!doctype html>");
  }

  CommandEndpoint operators_{studio_, kToken};
  std::promise<void> disk_sleeps_;
  std::shared_future<void> disk_ = disk_sleeps_.get_future().share();
  bool disk_is_awake_ = false;
  std::atomic<int> listings_ = 0;
  std::optional<WebSite> site_;
  std::optional<SiteHandler> handler_;
  std::unique_ptr<web::WebServer> server_;
  std::vector<std::unique_ptr<Client>> clients_;
};

TEST_F(ServedSite, runs_work_without_a_request) {
  std::promise<void> ran;
  server_->start_work({.work =
                           [&] {
                             ran.set_value();
                             return web::plain_response(200, "done");
                           },
                       .kind = web::WorkKind::kPicture});
  EXPECT_EQ(ran.get_future().wait_for(std::chrono::seconds(20)), std::future_status::ready);
}

/// Addresses of networks for examples.
TEST_F(ServedSite, listens_on_an_address_that_no_interface_has_yet) {
  const web::WebServer early(web::WebAddress{"198.51.100.1", 0}, *handler_);
  EXPECT_NE(early.port(), 0);
  const io::UniqueFd v6(socket(AF_INET6, SOCK_STREAM | SOCK_CLOEXEC, 0));
  if (!v6) return;  // this kernel has no IPv6
  const web::WebServer early_v6(web::WebAddress{"2001:db8::1", 0}, *handler_);
  EXPECT_NE(early_v6.port(), 0);
}

/// InputError would end the daemon with status 2, and systemd would not start it again.
TEST_F(ServedSite, reports_a_port_in_use_as_an_error_that_a_restart_may_remove) {
  try {
    const web::WebServer second(web::WebAddress{"127.0.0.1", server_->port()}, *handler_);
    FAIL() << "two servers have port " << second.port();
  } catch (const InputError& error) {
    FAIL() << "an InputError: " << error.what();
  } catch (const std::runtime_error& error) {
    EXPECT_THAT(error.what(), HasSubstr("cannot listen on 127.0.0.1:"));
  }
}

TEST_F(ServedSite, answers_while_half_open_requests_exceed_its_slots) {
  for (const char* from : {"127.0.0.2", "127.0.0.3", "127.0.0.4", "127.0.0.5"}) {
    occupy(50, from, "GET / HTTP/1.1\r\nHost: ");
  }
  EXPECT_TRUE(gets_page());
  EXPECT_TRUE(gets_page("127.0.0.2")) << "an address that holds many";
}

TEST_F(ServedSite, admits_an_operator_when_viewers_hold_all_common_slots) {
  for (const char* from : {"127.0.0.2", "127.0.0.3"}) {
    occupy(web::ConnectionSlots::kMaxPerAddress, from, request("/api/live", kUpgrade));
  }
  for (const auto& viewer : clients_) ASSERT_TRUE(viewer->receives("101 Switching"));
  const std::string token = std::string("X-V3D-Operator: ") + kToken + "\r\n";
  EXPECT_TRUE(client()->write(request("/")).receives("503"));
  EXPECT_TRUE(client()->write(request("/", "X-V3D-Operator: wrong\r\n")).receives("503"));
  EXPECT_TRUE(client()->write(request("/", token)).receives("<!doctype html>"));
  EXPECT_TRUE(client("127.0.0.2")->write(request("/", token)).receives("<!doctype html>"));
  EXPECT_TRUE(client()->write(request("/api/live", token + kUpgrade)).receives("503"))
      << "reserved slots are freed soon";
  occupy(3 * web::ConnectionSlots::kReserved, "127.0.0.4", "GET / HT");
  EXPECT_TRUE(client()->write(request("/", token)).receives("<!doctype html>"))
      << "unauthenticated clients hold the reserved slots";
  const std::ptrdiff_t viewers = web::ConnectionSlots::kMaxCommon;
  EXPECT_TRUE(std::none_of(clients_.begin(), clients_.begin() + viewers,
                           [](const auto& viewer) { return viewer->has_ended(); }));
}

class ServedTorrent : public ServedSite {
 protected:
  std::unique_ptr<web::WebStream> stream() override { return std::make_unique<Torrent>(taken_); }
  /// Waits until the server takes no more messages between two requests that it answers.
  bool waits_for_its_client() const {
    int before = -1;
    const auto is_still = [&] {
      const int now = *taken_;
      return gets_page() && std::exchange(before, now) == now;
    };
    return becomes_true(is_still, within(60));
  }

  const std::shared_ptr<std::atomic<int>> taken_ = std::make_shared<std::atomic<int>>(0);
};

TEST_F(ServedTorrent, takes_no_more_messages_for_a_client_that_never_reads) {
  const auto idle = client();
  idle->write(request("/api/live", kUpgrade));
  ASSERT_TRUE(becomes_true([&] { return *taken_ > 0; }, within(60)));
  ASSERT_TRUE(waits_for_its_client());
  EXPECT_LT(*taken_, Torrent::kMessages / 10) << "the sockets hold some MB";
}

/// Without a limit of unsent bytes, the kernel takes six messages.
TEST_F(ServedTorrent, queues_few_bytes_in_the_kernel_for_a_slow_client) {
  Client idle(server_->port(), "127.0.0.1", 4096);
  idle.write(request("/api/live", kUpgrade));
  ASSERT_TRUE(becomes_true([&] { return *taken_ > 0; }, within(60)));
  ASSERT_TRUE(waits_for_its_client());
  EXPECT_LE(*taken_, 3);
}

TEST_F(ServedSite, ends_a_slow_request_at_its_deadline) {
  const auto slow = client();
  slow->write("GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nX: ");
  // The limit of 5 s covers the whole request; a limit for each read would never apply.
  EXPECT_TRUE(becomes_true([&] { return slow->write("x").has_ended(); }, within(20)));
}

TEST_F(ServedSite, keeps_a_connection_between_requests_longer_than_a_request_may_take) {
  const auto kept = client();
  ASSERT_TRUE(kept->write(request("/")).receives("<!doctype html>"));
  const auto slow = client();
  slow->write("GET / HTTP/1.1\r\nHost: ");
  ASSERT_TRUE(becomes_true([&] { return slow->has_ended(); }, within(60)));
  EXPECT_FALSE(kept->has_ended());
  kept->write(request("/assets/a.js"));
  EXPECT_TRUE(kept->receives("let a"));
}

TEST_F(ServedSite, rejects_two_host_fields_and_user_information_in_one) {
  const auto two = client();
  two->write("GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nHost: evil.example\r\n\r\n");
  EXPECT_TRUE(two->receives("Host: expected one such field\n"));
  EXPECT_THAT(two->text(), StartsWith("HTTP/1.1 400"));
  const auto user = client();
  user->write("GET / HTTP/1.1\r\nHost: evil.example@127.0.0.1\r\n\r\n");
  EXPECT_TRUE(user->receives("no user information\n"));
  EXPECT_THAT(user->text(), StartsWith("HTTP/1.1 400"));
  const auto stream = client();
  stream->write("GET /api/live HTTP/1.1\r\nHost: a@127.0.0.1\r\n" + kUpgrade + "\r\n");
  EXPECT_TRUE(stream->receives("HTTP/1.1 400"));
}

TEST_F(ServedSite, answers_other_requests_while_a_slow_disk_lists_the_takes_once) {
  std::vector<std::unique_ptr<Client>> asking;
  for (int i = 0; i < 20; ++i) {
    asking.push_back(client());
    asking.back()->write(request("/api/takes"));
  }
  ASSERT_TRUE(becomes_true([&] { return listings_ == 1; }, within(20)));
  EXPECT_TRUE(gets_page());
  for (const auto& one : asking) EXPECT_EQ(one->text(), "") << "waits for the disk";
  wake_disk();
  for (const auto& one : asking) EXPECT_TRUE(one->receives("{\"takes\":[]}"));
  EXPECT_EQ(listings_, 1);
}

TEST_F(ServedSite, answers_304_for_an_unchanged_list_of_takes) {
  wake_disk();
  const auto first = client();
  ASSERT_TRUE(first->write(request("/api/takes")).receives("{\"takes\":[]}"));
  const std::string name = "ETag: ";
  const size_t begin = first->text().find(name);
  ASSERT_NE(begin, std::string::npos);
  const size_t value = begin + name.size();
  const std::string tag = first->text().substr(value, first->text().find('\r', begin) - value);
  const auto again = client();
  again->write(request("/api/takes", "If-None-Match: " + tag + "\r\n"));
  EXPECT_TRUE(again->receives("\r\n\r\n"));
  EXPECT_THAT(again->text(), StartsWith("HTTP/1.1 304"));
  EXPECT_THAT(again->text(), testing::Not(HasSubstr("{\"takes\"")));
  const auto other = client();
  EXPECT_TRUE(
      other->write(request("/api/takes", "If-None-Match: \"1\"\r\n")).receives("{\"takes\":[]}"));
}

TEST_F(ServedSite, answers_503_when_the_disk_does_not_list_the_takes_in_time) {
  serve({.disk_timeout = std::chrono::milliseconds(100)});
  const auto first = client();
  EXPECT_TRUE(first->write(request("/api/takes")).receives("503 Service"));
  EXPECT_THAT(first->text(), HasSubstr("the disk is slow to list its folders; try again\n"));
  EXPECT_TRUE(client()->write(request("/api/takes")).receives("503 Service"));
  EXPECT_EQ(listings_, 1) << "no second listing while one runs";
  wake_disk();
  EXPECT_TRUE(becomes_true(
      [&] { return client()->write(request("/api/takes")).receives("{\"takes\":[]}", 1); },
      within(20)));
}

TEST(ConnectionSlots, are_bounded_for_any_clients) {
  web::ConnectionSlots slots;
  for (int i = 0; i < 1000; ++i) {
    const auto slot = slots.acquire("10.0.0." + std::to_string(i % 7));
    if (slot && i % 3 != 0) slots.set_role(slot->id, web::ClientRole::kOperator);
  }
  EXPECT_EQ(slots.size(), web::ConnectionSlots::kMaxCommon + web::ConnectionSlots::kReserved);
  EXPECT_FALSE(slots.acquire("10.0.1.1")) << "operators hold all reserved slots";
}

TEST(ConnectionSlots, replace_the_oldest_unauthenticated_connection_of_the_address_first) {
  web::ConnectionSlots slots;
  const auto other = slots.acquire("10.0.0.1");
  const auto viewer = slots.acquire("10.0.0.2");
  slots.set_role(viewer->id, web::ClientRole::kViewer);
  const auto oldest = slots.acquire("10.0.0.2");
  for (size_t i = 2; i < web::ConnectionSlots::kMaxPerAddress; ++i) {
    EXPECT_FALSE(slots.acquire("10.0.0.2")->replaced);
  }
  EXPECT_EQ(slots.acquire("10.0.0.2")->replaced, oldest->id);
  slots.release(oldest->id);
  EXPECT_EQ(slots.size(), web::ConnectionSlots::kMaxPerAddress + 1) << "its slot was free already";
  EXPECT_FALSE(other->replaced);
}

}  // namespace
}  // namespace v3d::viewd
