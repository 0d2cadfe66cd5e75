#include "daemon/bus/bus.h"

#include <poll.h>
#include <spdlog/spdlog.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <exception>
#include <iterator>
#include <list>
#include <mutex>
#include <stdexcept>
#include <string>
#include <string_view>
#include <thread>

#include "base/config/studio_values.h"
#include "base/io/unique_fd.h"
#include "daemon/bus/channel_list.h"
#include "daemon/bus/frame_keys.h"
#include "daemon/bus/multicast_socket.h"

namespace v3d::bus {
namespace {

/// Matches channel names: one exact name, or a prefix followed by ".*".
class ChannelPattern {
 public:
  explicit ChannelPattern(std::string text) : text_(std::move(text)) {
    is_prefix_ = text_.ends_with(kAny);
    if (is_prefix_) text_.resize(text_.size() - kAny.size());
  }
  bool matches(std::string_view channel) const {
    return is_prefix_ ? channel.starts_with(text_) : channel == text_;
  }

 private:
  static constexpr std::string_view kAny = ".*";
  std::string text_;
  bool is_prefix_ = false;
};

}  // namespace

class Bus::Impl {
 public:
  Impl(const std::string& url, const std::vector<std::string>& frame_groups, ChannelList channels,
       MessageAuthenticator& authenticator)
      : frame_urls_(frame_groups),
        authenticator_(authenticator),
        sender_(url),
        common_(std::make_shared<MulticastReceiver>(url)),
        receiver_(
            std::move(channels), authenticator,
            [this](std::string_view channel) { return is_wanted(channel); }, session_port()) {
    for (const std::string& group : frame_urls_) {
      frame_senders_.push_back(std::make_unique<MulticastSender>(group));
    }
    if (frame_urls_.empty()) frame_senders_.push_back(std::make_unique<MulticastSender>(url));
    joined_groups_.resize(frame_urls_.size());
  }

  ~Impl() {
    stopping_ = true;
    eventfd_write(changed_.get(), 1);
    ring_.stop();
    if (receiving_.joinable()) receiving_.join();
    if (handling_.joinable()) handling_.join();
  }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  bool publish(const std::string& channel, std::span<const uint8_t> bytes, bool with_mac) {
    if (is_too_long(channel, bytes.size())) return false;
    if (!with_mac) return sender_.send(channel, bytes, nullptr);
    const auto key = authenticator_.members().key_for(channel);
    return sender_.send(channel, bytes, authenticator_.mac().get(), key ? &*key : nullptr);
  }

  size_t frame_groups() const { return std::max<size_t>(frame_urls_.size(), 1); }
  bool publish_frame(int64_t pulse, const std::string& channel, std::span<const uint8_t> bytes) {
    MulticastSender& sender = *frame_senders_[FrameNumbers::group_of(pulse, frame_senders_.size())];
    if (authenticator_.members().are_required()) {
      const auto key = own_frame_key_.sending(Monotonic::now());
      return key && sender.send_in(key->session, channel, bytes, &key->mac);
    }
    if (frame_urls_.empty()) return publish(channel, bytes, true);
    return sender.send(channel, bytes, authenticator_.mac().get());
  }

  void announce_frame_key(const std::string& node) {
    const auto list = authenticator_.members().list();
    if (!authenticator_.members().are_required() || !list) return;
    if (!own_frame_key_.adapt_to(*list, Monotonic::now()))
      authenticator_.report(kTooManyRecipients);
    const std::string channel = wire::frame_key_channel(node);
    {
      const std::lock_guard lock(frame_key_mutex_);
      frame_key_channel_ = channel;
      frame_key_repeats_ = 0;
    }
    send_frame_key(channel);
  }

  void join_frame_groups(const FrameGroupSet& groups) {
    std::exception_ptr failure;
    const std::lock_guard lock(mutex_);
    for (size_t i = 0; i < joined_groups_.size(); ++i) {
      if (!groups.contains(i)) {
        if (joined_groups_[i]) dropped_before_ += joined_groups_[i]->dropped();
        joined_groups_[i].reset();
      } else if (!joined_groups_[i]) {
        try {
          joined_groups_[i] = std::make_shared<MulticastReceiver>(frame_urls_[i]);
        } catch (const std::runtime_error&) {
          if (!failure) failure = std::current_exception();
        }
      }
    }
    eventfd_write(changed_.get(), 1);
    if (failure) std::rethrow_exception(failure);
  }

  HandlerRegistration subscribe(const std::string& channels, Handler handler, Accept accept) {
    const std::lock_guard lock(mutex_);
    const auto place =
        topics_.insert(topics_.end(), Topic{ChannelPattern(channels), std::move(handler), accept});
    if (!receiving_.joinable()) {
      receiving_ = std::thread([this] { receive(); });
      handling_ = std::thread([this] { handle(); });
    }
    return HandlerRegistration([this, place] {
      const std::lock_guard no_message(mutex_);
      topics_.erase(place);
    });
  }

  ReceptionCounts reception() const {
    const std::lock_guard lock(mutex_);
    int64_t dropped = dropped_before_ + common_->dropped();
    for (const auto& group : joined_groups_) dropped += group ? group->dropped() : 0;
    return {receiver_.counts(), dropped};
  }

 private:
  static constexpr char kTooManyRecipients[] =
      "the member list has more than 64 reconstruction keys; the others cannot verify live frames";
  /// Largest number of repetitions of a frame key between two calls of announce_frame_key(). Each
  /// costs a signature.
  static constexpr int kMaxRepeats = 10;

  /// Whether receivers would drop the message, so that it must not be sent.
  static bool is_too_long(const std::string& channel, size_t bytes) {
    const size_t limit = max_encoded_bytes(channel, true);
    if (bytes <= limit) return false;
    spdlog::error("{}: a message of {} bytes is not sent, receivers accept {}", channel, bytes,
                  limit);
    return true;
  }

  void send_frame_key(const std::string& channel) {
    wire::FrameKeyMessage message = own_frame_key_.announcement();
    message.sent = Realtime::now();
    publish(channel, encode(message), true);
  }
  void repeat_frame_key() {
    std::string channel;
    {
      const std::lock_guard lock(frame_key_mutex_);
      if (frame_key_channel_.empty() || frame_key_repeats_ == kMaxRepeats) return;
      ++frame_key_repeats_;
      channel = frame_key_channel_;
    }
    send_frame_key(channel);
  }

  struct Topic {
    ChannelPattern channels;
    Handler handler;
    Accept accept;
  };

  bool is_wanted(std::string_view channel) const {
    const std::lock_guard lock(mutex_);
    return std::ranges::any_of(topics_,
                               [&](const Topic& topic) { return topic.channels.matches(channel); });
  }

  void deliver(const ReceivedMessage& message) const {
    const std::lock_guard lock(mutex_);
    for (const Topic& topic : topics_) {
      const bool takes = message.is_accepted || topic.accept == Accept::kIncludingUnverified;
      if (takes && topic.channels.matches(message.channel)) topic.handler(message);
    }
  }

  SessionPort session_port() {
    return {.newest_of_own = [this](uint32_t session) { return newest_of_own(session); },
            .send =
                [this](wire::SessionMessage message) {
                  message.sent = Realtime::now();
                  publish(wire::kSessionChannel, encode(message), true);
                  if (message.is_answer) repeat_frame_key();
                }};
  }
  std::optional<uint32_t> newest_of_own(uint32_t session) const {
    if (sender_.session().number() == session) return sender_.session().newest();
    for (const auto& sender : frame_senders_) {
      if (sender->session().number() == session) return sender->session().newest();
    }
    return std::nullopt;
  }

  using Receivers = std::vector<std::shared_ptr<MulticastReceiver>>;
  Receivers joined() const {
    const std::lock_guard lock(mutex_);
    Receivers groups = {common_};
    std::copy_if(joined_groups_.begin(), joined_groups_.end(), std::back_inserter(groups),
                 [](const auto& group) { return group != nullptr; });
    return groups;
  }

  void receive() {
    while (!stopping_) receive_from(joined());
  }

  /// Receives until the set of joined groups changes. Sleeps in poll(), so an idle bus uses no CPU.
  void receive_from(const Receivers& groups) {
    std::vector<pollfd> watched = {{changed_.get(), POLLIN, 0}};
    for (const auto& group : groups) watched.push_back({group->fd(), POLLIN, 0});
    for (;;) {
      if (poll(watched.data(), watched.size(), -1) < 0 && errno != EINTR) return;
      if (watched[0].revents != 0) break;
      for (size_t i = 0; i < groups.size(); ++i) {
        if (watched[i + 1].revents != 0) groups[i]->receive(ring_);
      }
    }
    eventfd_t changes = 0;
    eventfd_read(changed_.get(), &changes);
  }

  /// Verifies, reassembles and delivers messages. Meanwhile new datagrams wait in the ring, because
  /// the kernel's receive buffer is small.
  void handle() {
    constexpr size_t kAtOnce = 8;  // small, so that places in the ring become free early
    for (;;) {
      const auto datagrams = ring_.wait(kAtOnce);
      if (datagrams.empty()) return;
      for (const DatagramRing::Received& datagram : datagrams) {
        const auto message =
            receiver_.receive(datagram.bytes, datagram.source, ReceiverTime::now());
        if (message) deliver(*message);
      }
      ring_.release(datagrams.size());
    }
  }

  const std::vector<std::string> frame_urls_;
  MessageAuthenticator& authenticator_;
  MulticastSender sender_;
  /// One for each frame group. Without frame groups: one, for frames with a frame key.
  std::vector<std::unique_ptr<MulticastSender>> frame_senders_;
  OwnFrameKey own_frame_key_;
  std::mutex frame_key_mutex_;     ///< guards the two below
  std::string frame_key_channel_;  ///< empty before the first announcement
  int frame_key_repeats_ = 0;      ///< since announce_frame_key()
  mutable std::mutex mutex_;       ///< guards the four below; held while handlers run
  std::list<Topic> topics_;
  std::shared_ptr<MulticastReceiver> common_;
  /// One receiver a frame group; null for groups that are not joined.
  std::vector<std::shared_ptr<MulticastReceiver>> joined_groups_;
  int64_t dropped_before_ = 0;  ///< datagrams, in groups that were left
  DatagramRing ring_;
  MessageReceiver receiver_;                             ///< handling thread only
  const io::UniqueFd changed_{eventfd(0, EFD_CLOEXEC)};  ///< readable when groups change or to stop
  std::atomic<bool> stopping_ = false;
  std::thread receiving_;  ///< empties the sockets into the ring
  std::thread handling_;   ///< runs the handlers
};

std::string receive_buffer_problem(const std::string& lcm_url) {
  const auto options = lcm_options(lcm_url);
  const int wanted = options ? options->recv_buf_size : 0;
  if (wanted == 0) return "";
  const io::UniqueFd probe = udp_socket();
  int reported = 0;
  socklen_t size = sizeof reported;
  setsockopt(probe.get(), SOL_SOCKET, SO_RCVBUF, &wanted, sizeof wanted);
  if (getsockopt(probe.get(), SOL_SOCKET, SO_RCVBUF, &reported, &size) != 0) return "";
  const int granted = reported / 2;  // Linux reports twice what it grants: socket(7)
  if (granted >= wanted) return "";
  return "network: the kernel gives a receive buffer of " + std::to_string(granted) +
         " bytes, the studio file asks for " + std::to_string(wanted) +
         "; try: sysctl net.core.rmem_max=" + std::to_string(wanted);
}

Bus::Bus(const std::string& lcm_url, const std::vector<std::string>& frame_groups,
         ChannelList channels)
    : impl_(std::make_unique<Impl>(lcm_url, frame_groups, std::move(channels), authenticator_)) {}
Bus::~Bus() = default;
bool Bus::publish(const std::string& channel, std::span<const uint8_t> bytes) {
  return impl_->publish(channel, bytes, false);
}
bool Bus::publish_authenticated(const std::string& channel, std::span<const uint8_t> message) {
  return impl_->publish(channel, message, true);
}
bool Bus::publish_command(std::span<const uint8_t> message) {
  return impl_->publish(wire::kCommandChannel, message, true);
}
bool Bus::publish_reply(std::span<const uint8_t> message) {
  return impl_->publish(wire::kReplyChannel, message, true);
}
size_t Bus::frame_groups() const { return impl_->frame_groups(); }
bool Bus::publish_frame(int64_t pulse, const std::string& channel,
                        std::span<const uint8_t> message) {
  return impl_->publish_frame(pulse, channel, message);
}
void Bus::announce_frame_key(const std::string& node) { impl_->announce_frame_key(node); }
void Bus::join_frame_groups(const FrameGroupSet& groups) { impl_->join_frame_groups(groups); }
ReceptionCounts Bus::reception() const { return impl_->reception(); }
Bus::HandlerRegistration Bus::subscribe(const std::string& channels, Handler handler,
                                        Accept accept) {
  return impl_->subscribe(channels, std::move(handler), accept);
}

}  // namespace v3d::bus
