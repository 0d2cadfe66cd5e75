// Fuzz target: a sequence of datagrams (u16 length, then the bytes) for receivers with a key,
// without a key, and with required members.
//
// Input without a valid MAC is accepted only on channels whose messages have their own MAC. Input
// with a valid MAC but without a member's signature is not accepted on channels that require a
// signature. With required members, a frame is accepted only with the MAC of the frame key of its
// node, and nothing else is accepted with it. Datagrams that the target signs give their message in
// any order and with any other datagrams between them.
#include <algorithm>
#include <cstdlib>
#include <memory>

#include "daemon/bus/message_receiver.h"

namespace {

using namespace v3d;

constexpr RealtimeInstant kNow = from_ns<Realtime>(1'700'000'000'000'000'000);
constexpr bus::ReceiverTime kReceiverNow{from_ns<Monotonic>(3'600'000'000'000), kNow};

const wire::StudioKey& key() {
  static const wire::StudioKey made = wire::StudioKey::parse(std::string(64, '7'), "studio.key");
  return made;
}

void must(bool condition) {
  if (!condition) std::abort();
}

/// Takes the next datagram from the front: a length (u16), then that number of bytes or what
/// remains.
std::span<const uint8_t> next(std::span<const uint8_t>& rest) {
  const size_t length = rest[0] | rest[1] << 8;
  rest = rest.subspan(2);
  const auto datagram = rest.first(std::min(length, rest.size()));
  rest = rest.subspan(datagram.size());
  return datagram;
}

bool is_wanted(std::string_view channel) { return !channel.starts_with("V3D_PREVIEW_"); }

const wire::SigningKey& member_key() {
  static const wire::SigningKey made = wire::SigningKey::make();
  return made;
}

Studio studio() {
  Studio studio;
  studio.nodes = {{"recon01"}};
  studio.cameras.resize(2);
  studio.cameras[0].name = "cam01";
  studio.cameras[0].node = "recon01";
  studio.cameras[1].name = "cam02";
  studio.cameras[1].node = "another";
  return studio;
}

/// Sessions of the member. The input may send in the first frame session; its sequence numbers may
/// be anything. The second one is for frames of the target.
constexpr uint32_t kMainSession = 9, kFrameSession = 10, kOwnFrameSession = 11;

/// The receivers under test. They exist once for each process, because 64 MiB are allocated for
/// each receiver.
struct Receivers {
  bus::MessageAuthenticator keyed_authenticator;
  bus::MessageAuthenticator keyless_authenticator;
  bus::MessageReceiver keyed{bus::ChannelList(), keyed_authenticator, is_wanted};
  bus::MessageReceiver keyless{bus::ChannelList(), keyless_authenticator, is_wanted};
  bus::MessageAuthenticator member_authenticator;
  wire::SessionMessage challenge;
  bus::MessageReceiver of_members{
      bus::ChannelList(studio()),
      member_authenticator,
      is_wanted,
      {.send = [this](const wire::SessionMessage& m) { challenge = m; }}};
  wire::DatagramMac mac{key()};
  wire::FrameKey frame_key = wire::FrameKey::make();
  wire::DatagramMac frame_mac = frame_key.mac();
  uint32_t sequence = 0;
  uint32_t frame_sequence = 0;
  Receivers() {
    keyed_authenticator.set_key(key());
    member_authenticator.set_key(key());
    member_authenticator.members().require();
    member_authenticator.members().set_members(
        std::make_shared<const wire::MemberList>(wire::MemberList{
            "kyoto", 1, {{"recon01", wire::Role::kReconstruction, member_key().public_key()}}}));
    member_authenticator.members().set_signing_key(member_key());
    learn_frame_key();
  }
  void learn_frame_key();
};

std::vector<uint8_t> bytes_of(const wire::DatagramMac& mac, uint32_t session,
                              bus::OutgoingDatagram& out) {
  out.trailer.session = session;
  out.trailer.sent = kNow;
  mac.sign(out.head(), out.data, out.trailer);
  std::vector<uint8_t> datagram(out.head().begin(), out.head().end());
  datagram.insert(datagram.end(), out.data.begin(), out.data.end());
  const auto end = out.trailer.bytes();
  datagram.insert(datagram.end(), end.begin(), end.end());
  return datagram;
}

/// The datagram of a short message of the member.
std::vector<uint8_t> member_datagram(Receivers& receivers, std::string_view channel,
                                     const wire::Bytes& message) {
  const uint32_t number = receivers.sequence++;
  const wire::Bytes bytes = sign_on_bus(
      message, {.channel = channel, .session = kMainSession, .sequence = number, .sent = kNow},
      member_key());
  auto datagrams = bus::split_message(number, channel, bytes, true);
  return bytes_of(receivers.mac, kMainSession, datagrams.at(0));
}

/// The member announces its frame sessions and responds to the challenge of its main session.
void Receivers::learn_frame_key() {
  wire::FrameKeyMessage announced{
      .sent = kNow, .session = kFrameSession, .newest = UINT32_MAX, .keys = {}};
  announced.keys.push_back(*frame_key.seal_for(member_key().public_key()));
  const auto send = [&](std::string_view channel, const wire::Bytes& message) {
    of_members.receive(member_datagram(*this, channel, message), 1, kReceiverNow);
  };
  send("V3D_FRAMEKEY_recon01", encode(announced));
  must(challenge.session == kMainSession);
  challenge.newest = 0;
  challenge.is_answer = true;
  send("V3D_SESSION", encode(challenge));
  send("V3D_FRAMEKEY_recon01", encode(announced));
  announced.session = kOwnFrameSession;
  send("V3D_FRAMEKEY_recon01", encode(announced));
}

/// The datagram that a holder of the key can send with these bytes as head and data.
std::vector<uint8_t> signed_datagram(const wire::DatagramMac& mac, std::span<const uint8_t> bytes,
                                     uint32_t session = 7) {
  const auto parsed = bus::parse_datagram(bytes);
  if (!parsed) return {};
  const auto data = parsed->data.first(parsed->data.size() -
                                       std::min(parsed->data.size(), wire::kMacTrailerSize));
  if (data.size() + wire::kMacTrailerSize != parsed->data.size()) return {};
  wire::MacTrailer trailer{.session = session, .sent = kNow, .tag = {}};
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

void check_datagram(Receivers& receivers, std::span<const uint8_t> bytes) {
  // A copy of exactly this length, so that AddressSanitizer detects a read beyond it.
  const std::vector<uint8_t> datagram(bytes.begin(), bytes.end());
  if (const auto got = receivers.keyed.receive(datagram, 1, kReceiverNow)) {
    must(!got->is_accepted);
    sum(got->bytes);
  }
  if (const auto got = receivers.keyless.receive(datagram, 1, kReceiverNow)) sum(got->bytes);
  const auto with_mac = signed_datagram(receivers.mac, datagram);
  if (const auto got = receivers.keyed.receive(with_mac, 1, kReceiverNow)) sum(got->bytes);
  if (const auto got = receivers.of_members.receive(with_mac, 1, kReceiverNow)) {
    const bus::ChannelKind& kind = *bus::kind_of(got->channel);
    must(!got->is_accepted || (!kind.is_signed() && !kind.is_of_frames));
    sum(got->bytes);
  }
  const auto with_studio_mac = signed_datagram(receivers.mac, datagram, kFrameSession);
  if (const auto got = receivers.of_members.receive(with_studio_mac, 1, kReceiverNow)) {
    must(!got->is_accepted || !bus::kind_of(got->channel)->is_of_frames);
  }
  const auto with_frame_mac = signed_datagram(receivers.frame_mac, datagram, kFrameSession);
  if (const auto got = receivers.of_members.receive(with_frame_mac, 1, kReceiverNow)) {
    must(!got->is_accepted || got->channel == "V3D_FRAME_cam01");
    sum(got->bytes);
  }
}

void check_message(Receivers& receivers, std::span<const uint8_t> bytes) {
  const std::vector<uint8_t> message(70'000 + bytes.size(), bytes.empty() ? 0 : bytes[0]);
  const wire::MessageOrigin origin{
      .channel = "V3D_MESH", .session = 8, .sequence = receivers.sequence++, .sent = kNow};
  const wire::Bytes signed_message = sign_on_bus(message, origin, member_key());
  auto datagrams = bus::split_message(origin.sequence, origin.channel, signed_message, true);
  if (!bytes.empty() && bytes[0] % 2 == 0) std::ranges::reverse(datagrams);
  std::optional<bus::ReceivedMessage> got, got_of_member;
  for (bus::OutgoingDatagram& out : datagrams) {
    const auto datagram = bytes_of(receivers.mac, 8, out);
    got = receivers.keyed.receive(datagram, 1, kReceiverNow);
    got_of_member = receivers.of_members.receive(datagram, 1, kReceiverNow);
    if (bytes.size() > 1) check_datagram(receivers, bytes);
  }
  must(got && std::ranges::equal(got->bytes, message));
  must(got_of_member && std::ranges::equal(got_of_member->bytes, message));
}

/// A frame of the member arrives, with any other datagrams between its fragments.
void check_frame(Receivers& receivers, std::span<const uint8_t> bytes) {
  const std::vector<uint8_t> message(70'000 + bytes.size(), bytes.empty() ? 0 : bytes[0]);
  std::optional<bus::ReceivedMessage> got;
  for (bus::OutgoingDatagram& out :
       bus::split_message(receivers.frame_sequence++, "V3D_FRAME_cam01", message, true)) {
    const auto datagram = bytes_of(receivers.frame_mac, kOwnFrameSession, out);
    got = receivers.of_members.receive(datagram, 1, kReceiverNow);
    if (bytes.size() > 1) check_datagram(receivers, bytes);
  }
  must(got && std::ranges::equal(got->bytes, message));
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static Receivers receivers;
  std::span<const uint8_t> rest(data, size);
  while (rest.size() > 2) check_datagram(receivers, next(rest));
  if (size < 64) {
    check_message(receivers, {data, size});
    check_frame(receivers, {data, size});
  }
  return 0;
}
