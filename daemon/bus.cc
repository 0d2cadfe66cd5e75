#include "daemon/bus.h"

#include <fcntl.h>
#include <lcm/lcm.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <list>
#include <map>
#include <mutex>
#include <thread>

#include "base/error.h"

namespace v3d {
namespace {

/// Frames of all cameras arrive at once; LCM drops silently beyond its own queue.
constexpr int kLcmQueue = 256;

struct Destroy {
  void operator()(lcm_t* lcm) const { lcm_destroy(lcm); }
};

/// LCM writes pages of advice to stderr while it joins; what matters of it we say ourselves, in one
/// line. Other threads' stderr is lost meanwhile.
class QuietStderr {
 public:
  QuietStderr() : kept_(fcntl(STDERR_FILENO, F_DUPFD_CLOEXEC, 3)) {
    std::fflush(stderr);
    const int nowhere = open("/dev/null", O_WRONLY | O_CLOEXEC);
    if (kept_ >= 0 && nowhere >= 0) dup2(nowhere, STDERR_FILENO);
    if (nowhere >= 0) close(nowhere);
  }
  ~QuietStderr() {
    std::fflush(stderr);
    if (kept_ < 0) return;
    dup2(kept_, STDERR_FILENO);
    close(kept_);
  }
  QuietStderr(const QuietStderr&) = delete;
  QuietStderr& operator=(const QuietStderr&) = delete;

 private:
  const int kept_;
};

[[noreturn]] void fail_network(const std::string& url) {
  throw InputError(
      "network.lcm_url: cannot join " + url +
      ": usually the multicast route is missing; try: ip link set dev IFACE multicast on && ip "
      "route add 239.255.76.67/32 dev IFACE (IFACE: lo on a single machine)");
}

}  // namespace

class Bus::Impl {
 public:
  explicit Impl(const std::string& url) : url_(url) {
    const QuietStderr quiet;
    lcm_.reset(lcm_create(url.c_str()));
    if (!lcm_) fail_network(url_);
    // The first subscription opens the socket, with more advice.
    lcm_subscription_t* first = lcm_subscribe(lcm_.get(), "", &Impl::on_nothing, nullptr);
    if (first == nullptr) fail_network(url_);
    lcm_unsubscribe(lcm_.get(), first);
  }

  ~Impl() {
    eventfd_write(stop_, 1);
    if (receiver_.joinable()) receiver_.join();
    close(stop_);
  }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  bool publish(const std::string& channel, std::span<const uint8_t> bytes) {
    return lcm_publish(lcm_.get(), channel.c_str(), bytes.data(),
                       static_cast<unsigned>(bytes.size())) == 0;
  }

  Listening subscribe(const std::string& channels, Handler handler) {
    const std::lock_guard lock(mutex_);
    Topic& topic = topic_of(channels);
    const auto place = topic.handlers.insert(topic.handlers.end(), std::move(handler));
    if (!receiver_.joinable()) receiver_ = std::thread([this] { receive(); });
    return Listening([this, &topic, place] {
      const std::lock_guard no_message(mutex_);
      topic.handlers.erase(place);
    });
  }

 private:
  static void on_nothing(const lcm_recv_buf_t*, const char*, void*) {}

  /// Those who listen to the same channels share what LCM keeps of it. That is never given back,
  /// since LCM may be calling just then; there are few kinds of channels, and takes without end.
  struct Topic {
    Impl& bus;
    std::list<Handler> handlers{};
  };

  Topic& topic_of(const std::string& channels) {
    const auto [found, is_new] = topics_.try_emplace(channels, Topic{*this});
    if (!is_new) return found->second;
    lcm_subscription_t* subscription =
        lcm_subscribe(lcm_.get(), channels.c_str(), &Impl::on_message, &found->second);
    if (subscription == nullptr) {
      topics_.erase(found);
      fail_network(url_);
    }
    lcm_subscription_set_queue_capacity(subscription, kLcmQueue);
    return found->second;
  }

  static void on_message(const lcm_recv_buf_t* received, const char* channel, void* user) {
    const Topic& topic = *static_cast<Topic*>(user);
    const std::lock_guard lock(topic.bus.mutex_);
    for (const Handler& handler : topic.handlers) {
      handler(channel, {static_cast<const uint8_t*>(received->data), received->data_size});
    }
  }

  /// Sleeps until there is something: an idle studio costs nothing.
  void receive() {
    std::array<pollfd, 2> watched = {{{lcm_get_fileno(lcm_.get()), POLLIN, 0}, {stop_, POLLIN, 0}}};
    for (;;) {
      if (poll(watched.data(), watched.size(), -1) < 0 && errno != EINTR) return;
      if (watched[1].revents != 0) return;
      if (watched[0].revents != 0) lcm_handle(lcm_.get());
    }
  }

  const std::string url_;
  std::unique_ptr<lcm_t, Destroy> lcm_;
  std::mutex mutex_;                          ///< the topics, while handlers run, too
  std::map<std::string, Topic> topics_;       // LCM holds their addresses
  const int stop_ = eventfd(0, EFD_CLOEXEC);  ///< readable when the thread shall end
  std::thread receiver_;
};

std::string receive_buffer_problem(const std::string& lcm_url) {
  constexpr std::string_view kOption = "recv_buf_size=";
  const size_t at = lcm_url.find(kOption);
  if (at == std::string::npos) return "";
  const int wanted = std::atoi(lcm_url.c_str() + at + kOption.size());
  const int probe = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  if (probe < 0) return "";
  int granted = 0;
  socklen_t size = sizeof granted;
  setsockopt(probe, SOL_SOCKET, SO_RCVBUF, &wanted, sizeof wanted);
  getsockopt(probe, SOL_SOCKET, SO_RCVBUF, &granted, &size);
  close(probe);
  if (granted >= wanted) return "";
  return "network: the kernel gives a receive buffer of " + std::to_string(granted) +
         " bytes, the studio file asks for " + std::to_string(wanted) +
         "; try: sysctl net.core.rmem_max=" + std::to_string(wanted);
}

Bus::Bus(const std::string& lcm_url) : impl_(std::make_unique<Impl>(lcm_url)) {}
Bus::~Bus() = default;
bool Bus::publish(const std::string& channel, std::span<const uint8_t> bytes) {
  return impl_->publish(channel, bytes);
}
Bus::Listening Bus::subscribe(const std::string& channels, Handler handler) {
  return impl_->subscribe(channels, std::move(handler));
}

}  // namespace v3d
