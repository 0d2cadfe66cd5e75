#include "daemon/bus/message_authenticator.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace v3d::bus {
namespace {

using namespace std::chrono_literals;

TEST(MessageAuthenticator, reports_the_reason_of_a_rejection_for_a_limited_time) {
  MessageAuthenticator authenticator;
  authenticator.set_key(wire::StudioKey::make());
  EXPECT_EQ(authenticator.trouble(Monotonic::now()), "");
  authenticator.count_unverified();
  EXPECT_EQ(authenticator.counts().forged, 1);
  EXPECT_THAT(authenticator.trouble(Monotonic::now()), testing::HasSubstr("another studio key"));
  EXPECT_EQ(authenticator.trouble(Monotonic::now() + 60s), "");
}

TEST(MessageAuthenticator, counts_no_datagram_as_forged_before_there_is_a_key) {
  MessageAuthenticator authenticator;
  authenticator.require_authentication();
  authenticator.count_unverified();
  EXPECT_EQ(authenticator.counts().forged, 0);
  EXPECT_EQ(authenticator.counts().unkeyed, 1);
  EXPECT_EQ(authenticator.trouble(Monotonic::now()), "")
      << "CredentialFiles reports the missing key";
}

TEST(MessageAuthenticator, counts_and_reports_messages_without_a_permitted_signature) {
  MessageAuthenticator authenticator;
  authenticator.set_key(wire::StudioKey::make());
  authenticator.count_unsigned("V3D_PULSE of member cap02");
  EXPECT_EQ(authenticator.counts().not_signed, 1);
  EXPECT_EQ(authenticator.counts().forged, 0);
  EXPECT_EQ(authenticator.trouble(Monotonic::now()), "V3D_PULSE of member cap02");
}

TEST(MessageAuthenticator, is_required_with_a_key_or_on_request) {
  MessageAuthenticator authenticator;
  EXPECT_FALSE(authenticator.is_required());
  authenticator.require_authentication();
  EXPECT_TRUE(authenticator.is_required());
  EXPECT_EQ(authenticator.mac(), nullptr);
  authenticator.set_key(wire::StudioKey::make());
  EXPECT_NE(authenticator.mac(), nullptr);
}

TEST(MemberSignatures, are_made_for_signed_channels_only_and_where_members_are_required) {
  const auto key = wire::SigningKey::make();
  MemberSignatures without_members, members;
  without_members.set_signing_key(key);
  EXPECT_FALSE(without_members.key_for(wire::kEventChannel));
  members.require();
  EXPECT_FALSE(members.key_for(wire::kEventChannel)) << "no key yet";
  members.set_signing_key(key);
  ASSERT_TRUE(members.key_for(wire::kEventChannel));
  EXPECT_EQ(members.key_for(wire::kEventChannel)->public_key(), key.public_key());
  EXPECT_FALSE(members.key_for(wire::kCommandChannel)) << "commands hold a signature of their own";
}

}  // namespace
}  // namespace v3d::bus
