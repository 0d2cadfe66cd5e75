#include "daemon/bus/message_seal.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace v3d {
namespace {

using namespace std::chrono_literals;

TEST(MessageSeal, reports_the_reason_of_a_rejection_for_a_limited_time) {
  MessageSeal seal;
  seal.set_key(StudioKey::make());
  EXPECT_EQ(seal.trouble(Realtime::now()), "");
  seal.count_unverified();
  EXPECT_EQ(seal.counts().forged, 1);
  EXPECT_THAT(seal.trouble(Realtime::now()), testing::HasSubstr("another studio key"));
  EXPECT_EQ(seal.trouble(Realtime::now() + 60s), "");
}

TEST(MessageSeal, counts_no_datagram_as_forged_before_there_is_a_key) {
  MessageSeal seal;
  seal.insist();
  seal.count_unverified();
  EXPECT_EQ(seal.counts().forged, 0);
  EXPECT_EQ(seal.counts().unkeyed, 1);
  EXPECT_EQ(seal.trouble(Realtime::now()), "") << "CredentialFiles reports the missing key";
}

TEST(MessageSeal, counts_and_reports_messages_without_a_permitted_signature) {
  MessageSeal seal;
  seal.set_key(StudioKey::make());
  seal.count_unsigned("V3D_PULSE of member cap02");
  EXPECT_EQ(seal.counts().not_signed, 1);
  EXPECT_EQ(seal.counts().forged, 0);
  EXPECT_EQ(seal.trouble(Realtime::now()), "V3D_PULSE of member cap02");
}

TEST(MessageSeal, is_required_with_a_key_or_on_request) {
  MessageSeal seal;
  EXPECT_FALSE(seal.is_required());
  seal.insist();
  EXPECT_TRUE(seal.is_required());
  EXPECT_EQ(seal.mac(), nullptr);
  seal.set_key(StudioKey::make());
  EXPECT_NE(seal.mac(), nullptr);
}

}  // namespace
}  // namespace v3d
