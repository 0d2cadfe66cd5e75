#include "daemon/bus/multicast_socket.h"

#include <arpa/inet.h>
#include <sys/socket.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <stdexcept>
#include <vector>

#include "base/config/studio_values.h"
#include "base/core/error.h"

namespace v3d::bus {
namespace {

/// Not an InputError: the network may come up later, so a daemon must be started again.
[[noreturn]] void fail_to_join(const std::string& url) {
  throw std::runtime_error(
      errno_message("network.lcm_url: cannot join " + url) +
      ": usually the multicast route is missing; try: ip link set dev IFACE multicast on && ip "
      "route add 239.255.76.67/32 dev IFACE (IFACE: lo on a single machine). For v3d-viewd with "
      "recorded takes only: lcm_url = \"\"");
}

void check_joined(bool succeeded, const std::string& url) {
  if (!succeeded) fail_to_join(url);
}

template <class Value>
bool set_option(int fd, int level, int name, const Value& value) {
  return setsockopt(fd, level, name, &value, sizeof value) == 0;
}

sockaddr_in address_of(const std::string& url) {
  const auto group = lcm_group(url);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  if (url.empty()) {
    throw InputError(
        "network.lcm_url is empty: this studio file is for v3d-viewd and recorded takes only");
  }
  if (!group || inet_pton(AF_INET, group->address.c_str(), &address.sin_addr) != 1) {
    throw InputError("network.lcm_url: cannot join " + url +
                     ": expected udpm://ADDRESS:PORT with an address in 239.0.0.0/8");
  }
  address.sin_port = htons(group->port);
  return address;
}

LcmOptions options_of(const std::string& url) {
  const auto options = lcm_options(url);
  if (options) return *options;
  throw InputError("network.lcm_url: " + url +
                   ": expected ttl=0 to 255 and recv_buf_size=BYTES behind the '?'");
}

const sockaddr* generic(const sockaddr_in& address) {
  return reinterpret_cast<const sockaddr*>(&address);
}

/// Checks that the kernel has a route to the group. Sends nothing.
void check_route(const sockaddr_in& group, const std::string& url) {
  const io::UniqueFd probe = udp_socket();
  check_joined(connect(probe.get(), generic(group), sizeof group) == 0, url);
}

}  // namespace

io::UniqueFd udp_socket() {
  io::UniqueFd fd(socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0));
  if (!fd) throw std::runtime_error(errno_message("network: cannot open a UDP socket"));
  return fd;
}

// --- receiving ----------------------------------------------------------------------------------

struct DatagramRing::Buffers {
  static constexpr size_t kRoom = 65'536;
  /// Ancillary data with the number of dropped datagrams (SO_RXQ_OVFL).
  using Control = std::array<uint8_t, CMSG_SPACE(sizeof(uint32_t))>;

  std::unique_ptr<uint8_t[]> bytes = std::make_unique_for_overwrite<uint8_t[]>(kPlaces * kRoom);
  std::array<mmsghdr, kPlaces> messages{};
  std::array<iovec, kPlaces> places{};
  std::array<sockaddr_in, kPlaces> sources{};
  alignas(cmsghdr) std::array<Control, kPlaces> controls{};
  std::array<Received, kPlaces> received{};

  Buffers() {
    for (size_t i = 0; i < kPlaces; ++i) {
      places[i] = {bytes.get() + i * kRoom, kRoom};
      messages[i].msg_hdr.msg_name = &sources[i];
      messages[i].msg_hdr.msg_iov = &places[i];
      messages[i].msg_hdr.msg_iovlen = 1;
      messages[i].msg_hdr.msg_control = controls[i].data();
    }
    prepare({0, kPlaces});
  }
  /// Restores the lengths that recvmmsg() has overwritten in these places.
  void prepare(FreeRange range) {
    for (size_t i = range.first; i < range.first + range.count; ++i) {
      messages[i].msg_hdr.msg_namelen = sizeof sources[i];
      messages[i].msg_hdr.msg_controllen = controls[i].size();
    }
  }
  Received datagram(size_t i) const {
    const uint64_t address = ntohl(sources[i].sin_addr.s_addr);
    return {{bytes.get() + i * kRoom, messages[i].msg_len},
            address << 16 | ntohs(sources[i].sin_port)};
  }
  /// Total of datagrams that this socket dropped, as reported with datagram `i`; 0 without a
  /// report.
  uint32_t drops(size_t i) {
    msghdr& header = messages[i].msg_hdr;
    uint32_t drops = 0;
    for (cmsghdr* c = CMSG_FIRSTHDR(&header); c != nullptr; c = CMSG_NXTHDR(&header, c)) {
      const bool counts = c->cmsg_level == SOL_SOCKET && c->cmsg_type == SO_RXQ_OVFL;
      if (counts) std::memcpy(&drops, CMSG_DATA(c), sizeof drops);
    }
    return drops;
  }
};

DatagramRing::DatagramRing() : buffers_(std::make_unique<Buffers>()) {}
DatagramRing::~DatagramRing() = default;

std::span<const DatagramRing::Received> DatagramRing::wait(size_t limit) {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [&] { return received_ > handled_ || stopped_; });
  if (stopped_) return {};
  const size_t first = handled_ % kPlaces;
  const size_t contiguous = std::min<uint64_t>(received_ - handled_, kPlaces - first);
  return std::span(buffers_->received).subspan(first, std::min(contiguous, limit));
}

void DatagramRing::release(size_t count) {
  {
    const std::lock_guard lock(mutex_);
    handled_ += count;
  }
  changed_.notify_all();
}

void DatagramRing::stop() {
  {
    const std::lock_guard lock(mutex_);
    stopped_ = true;
  }
  changed_.notify_all();
}

DatagramRing::FreeRange DatagramRing::wait_for_free_range() {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [&] { return received_ - handled_ < kPlaces || stopped_; });
  if (stopped_) return {};
  const size_t first = received_ % kPlaces;
  return {first, std::min<size_t>(kPlaces - (received_ - handled_), kPlaces - first)};
}

void DatagramRing::add(size_t count) {
  {
    const std::lock_guard lock(mutex_);
    received_ += count;
  }
  changed_.notify_all();
}

MulticastReceiver::MulticastReceiver(const std::string& url) : socket_(udp_socket()) {
  const sockaddr_in group = address_of(url);
  const LcmOptions options = options_of(url);
  const int fd = socket_.get();
  // Several processes of a PC bind this port. A socket that is bound to the group's address
  // receives only datagrams to that group.
  check_joined(set_option(fd, SOL_SOCKET, SO_REUSEADDR, 1), url);
  check_joined(set_option(fd, IPPROTO_IP, IP_MULTICAST_ALL, 0), url);
  set_option(fd, SOL_SOCKET, SO_RXQ_OVFL, 1);
  if (options.recv_buf_size > 0) set_option(fd, SOL_SOCKET, SO_RCVBUF, options.recv_buf_size);
  check_joined(bind(fd, generic(group), sizeof group) == 0, url);
  ip_mreq membership{};
  membership.imr_multiaddr = group.sin_addr;
  check_joined(set_option(fd, IPPROTO_IP, IP_ADD_MEMBERSHIP, membership), url);
}

size_t MulticastReceiver::receive(DatagramRing& ring) {
  constexpr size_t kAtOnce = 32;
  const DatagramRing::FreeRange range = ring.wait_for_free_range();
  if (range.count == 0) return 0;
  DatagramRing::Buffers& buffers = *ring.buffers_;
  const auto limit = static_cast<unsigned>(std::min(range.count, kAtOnce));
  const int received = recvmmsg(fd(), &buffers.messages[range.first], limit, MSG_DONTWAIT, nullptr);
  if (received <= 0) return 0;
  const auto count = static_cast<size_t>(received);
  for (size_t i = range.first; i < range.first + count; ++i) {
    buffers.received[i] = buffers.datagram(i);
    dropped_ = std::max<int64_t>(dropped_, buffers.drops(i));
  }
  buffers.prepare({range.first, count});
  ring.add(count);
  return count;
}

// --- sending ------------------------------------------------------------------------------------

MulticastSender::MulticastSender(const std::string& url)
    : socket_(udp_socket()), group_(address_of(url)) {
  const auto ttl = static_cast<uint8_t>(options_of(url).ttl);
  check_route(group_, url);
  check_joined(set_option(socket_.get(), IPPROTO_IP, IP_MULTICAST_TTL, ttl), url);
}

bool MulticastSender::send_in(SendingSession& session, std::string_view channel,
                              std::span<const uint8_t> message, const wire::DatagramMac* mac,
                              const wire::SigningKey* key) {
  const wire::MacTrailer trailer{.session = session.number(), .sent = Realtime::now(), .tag = {}};
  const uint32_t sequence = session.take_sequence();
  wire::Bytes with_signature;
  if (mac != nullptr && key != nullptr) {
    with_signature =
        sign_on_bus(message, {channel, session.number(), sequence, trailer.sent}, *key);
    message = with_signature;
  }
  std::vector<OutgoingDatagram> datagrams =
      split_message(sequence, channel, message, mac != nullptr);
  if (datagrams.empty()) return false;
  if (mac != nullptr) {
    for (OutgoingDatagram& datagram : datagrams) {
      datagram.trailer = trailer;
      mac->sign(datagram.head(), datagram.data, datagram.trailer);
    }
  }
  return send_all(datagrams, mac != nullptr);
}

bool MulticastSender::send_all(std::span<const OutgoingDatagram> datagrams, bool with_trailer) {
  struct Pieces {
    std::array<uint8_t, wire::kMacTrailerSize> trailer{};
    std::array<iovec, 3> places{};
  };
  const auto place = [](std::span<const uint8_t> bytes) {
    return iovec{const_cast<uint8_t*>(bytes.data()), bytes.size()};  // sendmmsg only reads
  };
  std::vector<Pieces> pieces(datagrams.size());
  std::vector<mmsghdr> messages(datagrams.size());
  for (size_t i = 0; i < datagrams.size(); ++i) {
    pieces[i].trailer = datagrams[i].trailer.bytes();
    pieces[i].places = {place(datagrams[i].head()), place(datagrams[i].data),
                        place(pieces[i].trailer)};
    msghdr& header = messages[i].msg_hdr;
    header.msg_name = &group_;
    header.msg_namelen = sizeof group_;
    header.msg_iov = pieces[i].places.data();
    header.msg_iovlen = with_trailer ? 3 : 2;
  }
  const std::lock_guard lock(one_message_);
  for (size_t sent = 0; sent < messages.size();) {
    const int count = sendmmsg(socket_.get(), messages.data() + sent,
                               static_cast<unsigned>(messages.size() - sent), 0);
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return false;
    sent += static_cast<size_t>(count);
  }
  return true;
}

}  // namespace v3d::bus
