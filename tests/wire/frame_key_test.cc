#include <gtest/gtest.h>

#include <array>

#include "wire/datagram_mac.h"
#include "wire/signatures.h"

namespace v3d::wire {
namespace {

class SealedKey : public testing::Test {
 protected:
  /// Whether both keys make the same MAC.
  static bool are_equal(const FrameKey& a, const FrameKey& b) {
    const std::array<uint8_t, 3> head = {1, 2, 3}, data = {4, 5, 6};
    MacTrailer trailer{.session = 7, .sent = {}, .tag = {}};
    a.mac().sign(head, data, trailer);
    return b.mac().verify(head, data, trailer);
  }

  const FrameKey key_ = FrameKey::make();
  const SigningKey recon01_ = SigningKey::make(), cap02_ = SigningKey::make();
};

TEST_F(SealedKey, is_opened_by_its_recipient) {
  const auto sealed = key_.seal_for(recon01_.public_key());
  ASSERT_TRUE(sealed);
  EXPECT_EQ(sealed->recipient, id_of(recon01_.public_key()));
  const auto opened = FrameKey::open(*sealed, recon01_);
  ASSERT_TRUE(opened);
  EXPECT_TRUE(are_equal(key_, *opened));
  EXPECT_FALSE(are_equal(FrameKey::make(), *opened));
}

TEST_F(SealedKey, is_opened_by_no_other_member) {
  EXPECT_FALSE(FrameKey::open(*key_.seal_for(recon01_.public_key()), cap02_));
}

TEST_F(SealedKey, is_rejected_with_any_bit_changed) {
  const auto sealed = key_.seal_for(recon01_.public_key());
  for (size_t bit = 0; bit < 8 * sealed->sealed.size(); ++bit) {
    SealedFrameKey changed = *sealed;
    changed.sealed[bit / 8] ^= static_cast<uint8_t>(1 << bit % 8);
    EXPECT_FALSE(FrameKey::open(changed, recon01_)) << "bit " << bit;
  }
}

TEST_F(SealedKey, differs_each_time) {
  const PublicKey recipient = recon01_.public_key();
  EXPECT_NE(key_.seal_for(recipient)->sealed, key_.seal_for(recipient)->sealed);
}

TEST_F(SealedKey, is_not_made_for_bytes_that_are_no_public_key) {
  EXPECT_FALSE(key_.seal_for(PublicKey{}));
  PublicKey ones;
  ones.bytes.fill(0xff);
  EXPECT_FALSE(key_.seal_for(ones));
}

/// The frame key alone decides: a datagram MAC of a studio key with the same bytes is another one.
TEST(FrameMac, differs_from_the_mac_of_a_studio_key_with_the_same_bytes) {
  SecretBuffer secret(32);
  for (uint8_t& byte : secret.bytes()) byte = 0x77;
  const DatagramMac frame_mac = FrameKey(std::move(secret)).mac();
  const DatagramMac studio_mac(StudioKey::parse(std::string(64, '7'), "studio.key"));
  const std::array<uint8_t, 3> head = {1, 2, 3}, data = {4, 5, 6};
  MacTrailer trailer{.session = 7, .sent = {}, .tag = {}};
  studio_mac.sign(head, data, trailer);
  EXPECT_TRUE(studio_mac.verify(head, data, trailer));
  EXPECT_FALSE(frame_mac.verify(head, data, trailer));
}

}  // namespace
}  // namespace v3d::wire
