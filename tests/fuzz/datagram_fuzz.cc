// Bytes as a sequence of datagrams (u16 length, then the bytes) for receivers with and without a
// key, and for one that requires members. Without the key nothing is accepted but what holds a MAC
// of its own. With the key and without a member's signature nothing is accepted on a channel whose
// messages are signed. Datagrams that this signs, in whatever order and with whatever else between
// them, give their message.
#include <algorithm>
#include <cstdlib>
#include <memory>

#include "daemon/bus/message_receiver.h"

namespace {

using namespace v3d;

constexpr RealtimeInstant kNow = from_ns<Realtime>(1'700'000'000'000'000'000);
constexpr ReceiverTime kReceiverNow{from_ns<Monotonic>(3'600'000'000'000), kNow};

const StudioKey& key() {
  static const StudioKey made = StudioKey::parse(std::string(64, '7'), "studio.key");
  return made;
}

void must(bool condition) {
  if (!condition) std::abort();
}

/// Takes up to 64 KiB from the front: the length, then so many bytes or what is left.
std::span<const uint8_t> next(std::span<const uint8_t>& rest) {
  const size_t length = rest[0] | rest[1] << 8;
  rest = rest.subspan(2);
  const auto datagram = rest.first(std::min(length, rest.size()));
  rest = rest.subspan(datagram.size());
  return datagram;
}

bool is_wanted(std::string_view channel) { return !channel.starts_with("V3D_PREVIEW_"); }

const SigningKey& member_key() {
  static const SigningKey made = SigningKey::make();
  return made;
}

/// Of one receiver that lives as long as the process: its 64 MiB are allocated once.
struct Parties {
  MessageSeal keyed_seal;
  MessageSeal keyless_seal;
  MessageReceiver keyed{ChannelList(), keyed_seal, is_wanted};
  MessageReceiver keyless{ChannelList(), keyless_seal, is_wanted};
  MessageSeal member_seal;
  MessageReceiver of_members{ChannelList(), member_seal, is_wanted};
  DatagramMac mac{key()};
  uint32_t sequence = 0;
  Parties() {
    keyed_seal.set_key(key());
    member_seal.set_key(key());
    member_seal.members().require();
    member_seal.members().set_members(std::make_shared<const MemberList>(
        MemberList{"kyoto", 1, {{"recon01", Role::kReconstruction, member_key().public_key()}}}));
  }
};

/// What the holder of the key can send with these bytes as head and data.
std::vector<uint8_t> signed_datagram(const DatagramMac& mac, std::span<const uint8_t> bytes) {
  const auto parsed = parse_datagram(bytes);
  if (!parsed) return {};
  const auto data =
      parsed->data.first(parsed->data.size() - std::min(parsed->data.size(), kMacTrailerSize));
  if (data.size() + kMacTrailerSize != parsed->data.size()) return {};
  MacTrailer trailer{.session = 7, .sent = kNow, .tag = {}};
  mac.sign(parsed->head, data, trailer);
  std::vector<uint8_t> made(parsed->head.begin(), parsed->head.end());
  made.insert(made.end(), data.begin(), data.end());
  const auto end = trailer.bytes();
  made.insert(made.end(), end.begin(), end.end());
  return made;
}

uint64_t sum(std::span<const uint8_t> bytes) {
  uint64_t sum = 0;
  for (const uint8_t byte : bytes) sum += byte;
  return sum;
}

void judge(Parties& parties, std::span<const uint8_t> bytes) {
  // Exactly as long as the datagram: a read beyond is seen.
  const std::vector<uint8_t> datagram(bytes.begin(), bytes.end());
  if (const auto got = parties.keyed.receive(datagram, 1, kReceiverNow)) {
    const bool holds_own = got->channel == "V3D_COMMAND" || got->channel == "V3D_REPLY";
    must(!got->is_accepted || holds_own);
    sum(got->bytes);
  }
  if (const auto got = parties.keyless.receive(datagram, 1, kReceiverNow)) sum(got->bytes);
  const auto with_mac = signed_datagram(parties.mac, datagram);
  if (const auto got = parties.keyed.receive(with_mac, 1, kReceiverNow)) sum(got->bytes);
  if (const auto got = parties.of_members.receive(with_mac, 1, kReceiverNow)) {
    must(!got->is_accepted || !kind_of(got->channel)->is_signed());
    sum(got->bytes);
  }
}

void carry_a_message(Parties& parties, std::span<const uint8_t> bytes) {
  const std::vector<uint8_t> message(70'000 + bytes.size(), bytes.empty() ? 0 : bytes[0]);
  const MessageOrigin origin{
      .channel = "V3D_MESH", .session = 8, .sequence = parties.sequence++, .sent = kNow};
  const Bytes signed_message = sign_on_bus(message, origin, member_key());
  auto datagrams = split_message(origin.sequence, origin.channel, signed_message, true);
  if (!bytes.empty() && bytes[0] % 2 == 0) std::ranges::reverse(datagrams);
  std::optional<ReceivedMessage> got, got_of_member;
  for (OutgoingDatagram& out : datagrams) {
    out.trailer.session = 8;
    out.trailer.sent = kNow;
    parties.mac.sign(out.head(), out.data, out.trailer);
    std::vector<uint8_t> datagram(out.head().begin(), out.head().end());
    datagram.insert(datagram.end(), out.data.begin(), out.data.end());
    const auto end = out.trailer.bytes();
    datagram.insert(datagram.end(), end.begin(), end.end());
    got = parties.keyed.receive(datagram, 1, kReceiverNow);
    got_of_member = parties.of_members.receive(datagram, 1, kReceiverNow);
    if (bytes.size() > 1) judge(parties, bytes);
  }
  must(got && std::ranges::equal(got->bytes, message));
  must(got_of_member && std::ranges::equal(got_of_member->bytes, message));
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static Parties parties;
  std::span<const uint8_t> rest(data, size);
  while (rest.size() > 2) judge(parties, next(rest));
  if (size < 64) carry_a_message(parties, {data, size});
  return 0;
}
