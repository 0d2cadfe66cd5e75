#include <gtest/gtest.h>

#include "wire/member_list.h"
#include "wire/signatures.h"

namespace v3d::wire {
namespace {

constexpr RealtimeInstant kSent = from_ns<Realtime>(1'700'000'000'000'000'000);
constexpr MessageOrigin kOrigin{
    .channel = "V3D_HEALTH_cap01", .session = 7, .sequence = 40, .sent = kSent};

class BusSignature : public testing::Test {
 protected:
  bool is_valid(std::span<const uint8_t> bytes, const MessageOrigin& origin = kOrigin) const {
    const auto split = split_signature(bytes);
    return split && !members_.signers_of(*split, origin).empty();
  }

  const SigningKey key_ = SigningKey::make();
  const MemberList members_{
      .studio = "kyoto", .serial = 1, .members = {{"cap01", Role::kCapture, key_.public_key()}}};
  const Bytes message_ = encode(HealthMessage{});
};

TEST_F(BusSignature, is_valid_for_the_sent_message) {
  const Bytes bytes = sign_on_bus(message_, kOrigin, key_);
  EXPECT_EQ(bytes.size(), message_.size() + kMessageSignatureSize);
  EXPECT_TRUE(is_valid(bytes));
  EXPECT_FALSE(is_valid(sign_on_bus(message_, kOrigin, SigningKey::make())));
}

TEST_F(BusSignature, is_invalid_on_another_channel_in_another_session_or_at_another_time) {
  const Bytes bytes = sign_on_bus(message_, kOrigin, key_);
  MessageOrigin other = kOrigin;
  other.channel = "V3D_HEALTH_cap02";
  EXPECT_FALSE(is_valid(bytes, other));
  other = kOrigin;
  other.session = 8;
  EXPECT_FALSE(is_valid(bytes, other));
  other = kOrigin;
  other.sequence = 41;
  EXPECT_FALSE(is_valid(bytes, other));
  other = kOrigin;
  other.sent += std::chrono::microseconds(1);
  EXPECT_FALSE(is_valid(bytes, other));
}

TEST_F(BusSignature, is_invalid_with_a_changed_bit_or_without_its_last_bytes) {
  const Bytes bytes = sign_on_bus(message_, kOrigin, key_);
  for (size_t bit = 0; bit < 8 * bytes.size(); ++bit) {
    Bytes changed = bytes;
    changed[bit / 8] ^= static_cast<uint8_t>(1 << bit % 8);
    EXPECT_FALSE(is_valid(changed)) << "bit " << bit;
  }
  for (size_t size = 0; size < bytes.size(); ++size) {
    EXPECT_FALSE(is_valid(std::span(bytes).first(size))) << size << " bytes";
  }
}

TEST_F(BusSignature, and_the_signature_of_a_command_are_not_interchangeable) {
  EXPECT_FALSE(is_valid(sign_message(message_, key_)));
  const Bytes bytes = sign_on_bus(message_, kOrigin, key_);
  EXPECT_TRUE(members_.signers_of(*split_signature(bytes)).empty());
}

/// Both origins would give the same bytes without the zero byte after the channel.
TEST_F(BusSignature, separates_the_channel_from_the_session) {
  constexpr int64_t kMicroseconds = 1'700'000'000'000'077;
  const Bytes bytes = sign_on_bus(message_,
                                  {.channel = "V3D_A1",
                                   .session = 7,
                                   .sequence = 0,
                                   .sent = from_ns<Realtime>(1000 * kMicroseconds)},
                                  key_);
  Bytes longer = bytes;
  longer.insert(longer.begin(), static_cast<uint8_t>(kMicroseconds));
  EXPECT_FALSE(is_valid(longer, {.channel = "V3D_A",
                                 .session = '1' << 24,
                                 .sequence = 7 << 24,
                                 .sent = from_ns<Realtime>(1000 * (kMicroseconds >> 8))}));
}

}  // namespace
}  // namespace v3d::wire
