#include <gtest/gtest.h>

#include <array>

#include "daemon/bus/frame_keys.h"

namespace v3d::bus {
namespace {

using namespace std::chrono_literals;

constexpr MonotonicInstant kNow = from_ns<Monotonic>(3'600'000'000'000);

class OwnFrameKeyTest : public testing::Test {
 protected:
  static wire::Member recon(const std::string& name, const wire::SigningKey& key) {
    return {name, wire::Role::kReconstruction, key.public_key()};
  }
  bool adapt_to(std::vector<wire::Member> members, MonotonicInstant now) {
    members.push_back({"cap01", wire::Role::kCapture, wire::SigningKey::make().public_key()});
    return own_.adapt_to({.studio = "kyoto", .serial = 1, .members = std::move(members)}, now);
  }
  uint32_t sends_in(MonotonicInstant now) const { return own_.sending(now)->session.number(); }

  const wire::SigningKey first_ = wire::SigningKey::make(), second_ = wire::SigningKey::make();
  OwnFrameKey own_;
};

TEST_F(OwnFrameKeyTest, is_sealed_for_the_keys_of_reconstruction_nodes_only) {
  EXPECT_EQ(own_.sending(kNow), nullptr);
  EXPECT_TRUE(adapt_to({recon("recon01", first_), recon("recon01", second_)}, kNow));
  const wire::FrameKeyMessage message = own_.announcement();
  ASSERT_EQ(message.keys.size(), 2U) << "a member with two keys gets two entries";
  EXPECT_EQ(message.session, sends_in(kNow));
  EXPECT_EQ(message.newest, UINT32_MAX) << "no frame was sent";
  const std::array<uint8_t, 3> bytes = {1, 2, 3};
  wire::MacTrailer trailer;
  own_.sending(kNow)->mac.sign(bytes, bytes, trailer);
  for (const wire::SealedFrameKey& sealed : message.keys) {
    const wire::SigningKey& owner =
        sealed.recipient == id_of(first_.public_key()) ? first_ : second_;
    const auto key = wire::FrameKey::open(sealed, owner);
    ASSERT_TRUE(key);
    EXPECT_TRUE(key->mac().verify(bytes, bytes, trailer));
  }
}

TEST_F(OwnFrameKeyTest, is_sealed_once_for_a_key_that_two_nodes_share) {
  adapt_to({recon("recon01", first_), recon("recon02", first_)}, kNow);
  EXPECT_EQ(own_.announcement().keys.size(), 1U);
}

TEST_F(OwnFrameKeyTest, remains_when_other_members_change) {
  adapt_to({recon("recon01", first_), recon("recon02", second_)}, kNow);
  const wire::FrameKeyMessage before = own_.announcement();
  adapt_to({recon("recon02", second_),
            recon("recon01", first_),
            {"ada", wire::Role::kOperator, wire::SigningKey::make().public_key()}},
           kNow + 1s);
  EXPECT_EQ(own_.announcement().session, before.session);
  EXPECT_EQ(own_.announcement().keys[0].sealed, before.keys[0].sealed);
}

TEST_F(OwnFrameKeyTest, changes_when_a_reconstruction_key_does_and_is_used_a_second_later) {
  adapt_to({recon("recon01", first_), recon("recon02", second_)}, kNow);
  const uint32_t before = sends_in(kNow);
  adapt_to({recon("recon01", first_)}, kNow + 5s);
  const wire::FrameKeyMessage message = own_.announcement();
  EXPECT_NE(message.session, before);
  ASSERT_EQ(message.keys.size(), 1U);
  EXPECT_EQ(message.keys[0].recipient, id_of(first_.public_key()));
  EXPECT_EQ(sends_in(kNow + 6s - 1ms), before);
  EXPECT_EQ(sends_in(kNow + 6s), message.session);
}

TEST_F(OwnFrameKeyTest, is_sealed_for_64_keys_at_most) {
  std::vector<wire::Member> many;
  while (many.size() < wire::kMaxFrameKeyRecipients)
    many.push_back(recon("recon", wire::SigningKey::make()));
  EXPECT_TRUE(adapt_to(many, kNow));
  EXPECT_EQ(own_.announcement().keys.size(), wire::kMaxFrameKeyRecipients);
  many.push_back(recon("recon", wire::SigningKey::make()));
  EXPECT_FALSE(adapt_to(many, kNow));
  EXPECT_EQ(own_.announcement().keys.size(), wire::kMaxFrameKeyRecipients);
}

}  // namespace
}  // namespace v3d::bus
