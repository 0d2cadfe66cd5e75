#include "wire/datagram_mac.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

namespace v3d::wire {
namespace {

const StudioKey& key() {
  static const StudioKey made = StudioKey::parse(std::string(64, '7'), "studio.key");
  return made;
}

struct Signed {
  std::vector<uint8_t> head, data;
  MacTrailer trailer;

  bool verifies(const DatagramMac& mac) const { return mac.verify(head, data, trailer); }
};

Signed any_signed(const DatagramMac& mac) {
  Signed made;
  made.head =
      *rc::gen::nonEmpty(rc::gen::container<std::vector<uint8_t>>(rc::gen::arbitrary<uint8_t>()));
  made.data =
      *rc::gen::nonEmpty(rc::gen::container<std::vector<uint8_t>>(rc::gen::arbitrary<uint8_t>()));
  made.trailer.session = *rc::gen::arbitrary<uint32_t>();
  made.trailer.sent = from_ns<Realtime>(1000 * *rc::gen::inRange<int64_t>(0, int64_t{1} << 52));
  mac.sign(made.head, made.data, made.trailer);
  return made;
}

RC_GTEST_PROP(DatagramMac, accepts_a_signed_datagram_and_rejects_it_with_one_flipped_bit, ()) {
  const DatagramMac mac(key());
  const Signed made = any_signed(mac);
  RC_ASSERT(made.verifies(mac));
  Signed changed = made;
  auto& part = *rc::gen::arbitrary<bool>() ? changed.head : changed.data;
  part[*rc::gen::inRange<size_t>(0, part.size())] ^=
      static_cast<uint8_t>(1 << *rc::gen::inRange(0, 8));
  RC_ASSERT(!changed.verifies(mac));
}

RC_GTEST_PROP(DatagramMac, authenticates_every_bit_of_its_trailer, ()) {
  const DatagramMac mac(key());
  const Signed made = any_signed(mac);
  auto bytes = made.trailer.bytes();
  RC_ASSERT(read_trailer(bytes)->tag == made.trailer.tag);
  bytes[*rc::gen::inRange<size_t>(0, bytes.size())] ^=
      static_cast<uint8_t>(1 << *rc::gen::inRange(0, 8));
  const auto read = read_trailer(bytes);
  RC_ASSERT(!read || !mac.verify(made.head, made.data, *read));
}

RC_GTEST_PROP(DatagramMac, rejects_another_key_and_a_shifted_boundary_of_head_and_data, ()) {
  const DatagramMac mac(key());
  const Signed made = any_signed(mac);
  RC_ASSERT(!made.verifies(DatagramMac(StudioKey::make())));
  Signed shifted = made;  // move one byte from the head to the data
  shifted.data.insert(shifted.data.begin(), shifted.head.back());
  shifted.head.pop_back();
  RC_ASSERT(!shifted.verifies(mac));
}

}  // namespace
}  // namespace v3d::wire
