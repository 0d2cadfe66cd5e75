#include "daemon/bus.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <lcm/lcm.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <iterator>
#include <list>
#include <map>
#include <mutex>
#include <set>
#include <string>
#include <thread>

#include "base/error.h"
#include "base/lcm_group.h"

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

std::set<int> open_files() {
  std::set<int> files;
  for (const auto& entry : std::filesystem::directory_iterator("/proc/self/fd")) {
    files.insert(std::atoi(entry.path().filename().c_str()));
  }
  return files;
}

/// What was opened since leaves the group. LCM joins with the socket that it sends from as well,
/// and does not show it; a switch would send all frames to whoever can send one.
void leave_with_what_is_new(const std::set<int>& before, const std::string& url) {
  const auto group = lcm_group(url);
  ip_mreq membership{};
  if (!group || inet_pton(AF_INET, group->address.c_str(), &membership.imr_multiaddr) != 1) return;
  for (const int file : open_files()) {
    if (before.contains(file)) continue;
    // Fails where it is no socket, or was no member.
    setsockopt(file, IPPROTO_IP, IP_DROP_MEMBERSHIP, &membership, sizeof membership);
  }
}

}  // namespace

/// One multicast group.
class Bus::Group {
 public:
  explicit Group(std::string url) : url_(std::move(url)), lcm_(lcm_create(url_.c_str())) {
    if (!lcm_) fail_network(url_);
  }
  Group(const Group&) = delete;
  Group& operator=(const Group&) = delete;

  /// Is sent to, and not heard.
  static std::unique_ptr<Group> to_send(const std::string& url) {
    const std::set<int> before = open_files();
    auto group = std::make_unique<Group>(url);
    leave_with_what_is_new(before, url);
    return group;
  }

  bool publish(const std::string& channel, std::span<const uint8_t> bytes) {
    return lcm_publish(lcm_.get(), channel.c_str(), bytes.data(),
                       static_cast<unsigned>(bytes.size())) == 0;
  }
  /// The first subscription joins the group; to send needs none.
  void join() {
    const auto on_nothing = [](const lcm_recv_buf_t*, const char*, void*) {};
    lcm_unsubscribe(lcm_.get(), subscribe("", on_nothing, nullptr));
  }
  lcm_subscription_t* subscribe(const std::string& channels, lcm_msg_handler_t handler,
                                void* user) {
    lcm_subscription_t* subscription = lcm_subscribe(lcm_.get(), channels.c_str(), handler, user);
    if (subscription == nullptr) fail_network(url_);
    lcm_subscription_set_queue_capacity(subscription, kLcmQueue);
    return subscription;
  }
  int readable() const { return lcm_get_fileno(lcm_.get()); }
  void handle() { lcm_handle(lcm_.get()); }

 private:
  const std::string url_;
  const std::unique_ptr<lcm_t, Destroy> lcm_;
};

class Bus::Impl {
 public:
  Impl(const std::string& url, const std::vector<std::string>& frame_groups)
      : frame_urls_(frame_groups) {
    const QuietStderr quiet;
    common_ = std::make_shared<Group>(url);
    common_->join();
    for (const std::string& group : frame_urls_) {
      frame_senders_.push_back(Group::to_send(group));
    }
    heard_.resize(frame_urls_.size());
  }

  ~Impl() {
    stopping_ = true;
    eventfd_write(changed_, 1);
    if (receiver_.joinable()) receiver_.join();
    close(changed_);
  }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  bool publish(const std::string& channel, std::span<const uint8_t> bytes) {
    return common_->publish(channel, bytes);
  }

  size_t frame_groups() const { return std::max<size_t>(frame_urls_.size(), 1); }
  bool publish_frame(int64_t pulse, const std::string& channel, std::span<const uint8_t> bytes) {
    if (frame_urls_.empty()) return publish(channel, bytes);
    return frame_senders_[FrameNumbers::group_of(pulse, frame_senders_.size())]->publish(channel,
                                                                                         bytes);
  }

  void hear_frames(const FrameGroupSet& groups) {
    const std::lock_guard lock(mutex_);
    for (size_t i = 0; i < heard_.size(); ++i) {
      if (!groups.contains(i)) {
        heard_[i].reset();
      } else if (!heard_[i]) {
        auto group = std::make_shared<Group>(frame_urls_[i]);
        group->join();
        for (auto& [channels, topic] : topics_) subscribe_at(*group, channels, topic);
        heard_[i] = std::move(group);
      }
    }
    eventfd_write(changed_, 1);
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
  /// Those who listen to the same channels share what LCM keeps of it. That is never given back,
  /// since LCM may be calling just then; there are few kinds of channels, and takes without end.
  struct Topic {
    Impl& bus;
    std::list<Handler> handlers{};
  };

  Topic& topic_of(const std::string& channels) {
    const auto [found, is_new] = topics_.try_emplace(channels, Topic{*this});
    if (!is_new) return found->second;
    try {
      subscribe_at(*common_, channels, found->second);
    } catch (const InputError&) {
      topics_.erase(found);
      throw;
    }
    for (const auto& group : heard_) {
      if (group) subscribe_at(*group, channels, found->second);
    }
    return found->second;
  }
  static void subscribe_at(Group& group, const std::string& channels, Topic& topic) {
    group.subscribe(channels, &Impl::on_message, &topic);
  }

  static void on_message(const lcm_recv_buf_t* received, const char* channel, void* user) {
    const Topic& topic = *static_cast<Topic*>(user);
    const std::lock_guard lock(topic.bus.mutex_);
    for (const Handler& handler : topic.handlers) {
      handler(channel, {static_cast<const uint8_t*>(received->data), received->data_size});
    }
  }

  std::vector<std::shared_ptr<Group>> joined() {
    const std::lock_guard lock(mutex_);
    std::vector<std::shared_ptr<Group>> groups = {common_};
    std::copy_if(heard_.begin(), heard_.end(), std::back_inserter(groups),
                 [](const auto& group) { return group != nullptr; });
    return groups;
  }

  void receive() {
    while (!stopping_) receive_from(joined());
  }

  /// Until the groups change. Sleeps until there is something: an idle studio costs nothing.
  void receive_from(const std::vector<std::shared_ptr<Group>>& groups) {
    std::vector<pollfd> watched = {{changed_, POLLIN, 0}};
    for (const auto& group : groups) watched.push_back({group->readable(), POLLIN, 0});
    for (;;) {
      if (poll(watched.data(), watched.size(), -1) < 0 && errno != EINTR) return;
      if (watched[0].revents != 0) break;
      for (size_t i = 0; i < groups.size(); ++i) {
        if (watched[i + 1].revents != 0) groups[i]->handle();
      }
    }
    eventfd_t changes = 0;
    eventfd_read(changed_, &changes);
  }

  const std::vector<std::string> frame_urls_;
  std::shared_ptr<Group> common_;
  std::vector<std::unique_ptr<Group>> frame_senders_;
  std::mutex mutex_;                           ///< what follows, while handlers run, too
  std::map<std::string, Topic> topics_;        // LCM holds their addresses
  std::vector<std::shared_ptr<Group>> heard_;  ///< of the frame groups; empty where it is not heard
  const int changed_ = eventfd(0, EFD_CLOEXEC);  ///< readable when the thread shall look
  std::atomic<bool> stopping_ = false;
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

Bus::Bus(const std::string& lcm_url, const std::vector<std::string>& frame_groups)
    : impl_(std::make_unique<Impl>(lcm_url, frame_groups)) {}
Bus::~Bus() = default;
bool Bus::publish(const std::string& channel, std::span<const uint8_t> bytes) {
  return impl_->publish(channel, bytes);
}
size_t Bus::frame_groups() const { return impl_->frame_groups(); }
bool Bus::publish_frame(int64_t pulse, const std::string& channel, Bytes message) {
  return impl_->publish_frame(pulse, channel, seal_.closed(std::move(message)));
}
void Bus::hear_frames(const FrameGroupSet& groups) { impl_->hear_frames(groups); }
Bus::Listening Bus::subscribe(const std::string& channels, Handler handler) {
  return impl_->subscribe(channels, std::move(handler));
}

}  // namespace v3d
