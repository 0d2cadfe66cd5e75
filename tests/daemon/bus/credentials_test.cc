#include "daemon/bus/credentials.h"

#include <gtest/gtest.h>

namespace v3d::bus {
namespace {

using Result = OpenedCommand::Result;

constexpr MonotonicInstant kNow = from_ns<Monotonic>(3'600'000'000'000);

/// A studio whose members are an operator, two nodes and a viewer.
class MemberCredentials : public testing::Test {
 protected:
  MemberCredentials() {
    credentials_.set_studio_key(studio_key_, kNow);
    credentials_.require_members();
    credentials_.set_signing_key(cap01_);
    set_members(all());
  }
  std::vector<wire::Member> all() const {
    return {{"ada", wire::Role::kOperator, ada_.public_key()},
            {"cap01", wire::Role::kCapture, cap01_.public_key()},
            {"recon01", wire::Role::kReconstruction, recon01_.public_key()},
            {"guest", wire::Role::kViewer, guest_.public_key()}};
  }
  void set_members(std::vector<wire::Member> members) {
    credentials_.set_members(std::make_shared<const wire::MemberList>(
        wire::MemberList{.studio = "kyoto", .serial = ++serial_, .members = std::move(members)}));
  }
  static wire::Bytes command() {
    wire::CommandMessage command;
    command.sender = "ada@desk";
    return encode(command);
  }
  static wire::Bytes reply(const std::string& node) {
    wire::ReplyMessage reply;
    reply.node = node;
    return encode(reply);
  }
  OpenedCommand opened(const wire::SigningKey& key) const {
    const wire::Bytes bytes = sign_message(command(), key);
    OpenedCommand opened = credentials_.open_command(bytes, kNow);
    opened.message = {};  // a view into `bytes`
    return opened;
  }
  bool replies(const wire::SigningKey& key, const std::string& node) const {
    return credentials_.open_reply(sign_message(reply(node), key), kNow).has_value();
  }

  const wire::StudioKey studio_key_ = wire::StudioKey::make();
  const wire::SigningKey ada_ = wire::SigningKey::make(), cap01_ = wire::SigningKey::make(),
                         recon01_ = wire::SigningKey::make(), guest_ = wire::SigningKey::make();
  Credentials credentials_;
  int64_t serial_ = 0;
};

TEST_F(MemberCredentials, accept_commands_of_operators_only) {
  EXPECT_EQ(opened(ada_).result, Result::kAccepted);
  EXPECT_EQ(opened(ada_).signer, "ada");
  for (const wire::SigningKey* key : {&cap01_, &recon01_, &guest_}) {
    EXPECT_EQ(opened(*key).result, Result::kUnauthorized);
  }
  EXPECT_EQ(opened(guest_).signer, "guest");
  EXPECT_EQ(opened(wire::SigningKey::make()).result, Result::kForged);
}

TEST_F(MemberCredentials, accept_a_reply_only_from_the_node_that_it_names) {
  EXPECT_TRUE(replies(cap01_, "cap01"));
  EXPECT_TRUE(replies(recon01_, "recon01"));
  EXPECT_FALSE(replies(cap01_, "recon01"));
  EXPECT_FALSE(replies(cap01_, "cap02"));
  EXPECT_FALSE(replies(ada_, "cap01"));
  EXPECT_FALSE(replies(ada_, "ada")) << "an operator is not a node";
  EXPECT_FALSE(replies(guest_, "guest"));
  EXPECT_FALSE(replies(wire::SigningKey::make(), "cap01"));
}

TEST_F(MemberCredentials, reject_a_mac_of_the_studio_key_instead_of_a_signature) {
  wire::Bytes authenticated = command();
  studio_key_.add_mac(authenticated);
  EXPECT_EQ(credentials_.open_command(authenticated, kNow).result, Result::kForged);
  wire::Bytes authenticated_reply = reply("cap01");
  studio_key_.add_mac(authenticated_reply);
  EXPECT_FALSE(credentials_.open_reply(authenticated_reply, kNow));
}

TEST_F(MemberCredentials, reject_a_command_with_a_changed_bit) {
  const wire::Bytes bytes = sign_message(command(), ada_);
  for (size_t bit = 0; bit < 8 * bytes.size(); ++bit) {
    wire::Bytes changed = bytes;
    changed[bit / 8] ^= static_cast<uint8_t>(1 << bit % 8);
    EXPECT_EQ(credentials_.open_command(changed, kNow).result, Result::kForged) << "bit " << bit;
  }
}

TEST_F(MemberCredentials, accept_a_member_while_the_list_contains_it) {
  std::vector<wire::Member> others = all();
  others.erase(others.begin());
  set_members(others);
  EXPECT_EQ(opened(ada_).result, Result::kForged);
  set_members(all());
  EXPECT_EQ(opened(ada_).result, Result::kAccepted);
}

TEST_F(MemberCredentials, accept_two_keys_of_a_member_while_one_is_replaced) {
  const wire::SigningKey next = wire::SigningKey::make();
  std::vector<wire::Member> members = all();
  members.push_back({"cap01", wire::Role::kCapture, next.public_key()});
  set_members(members);
  EXPECT_TRUE(replies(cap01_, "cap01"));
  EXPECT_TRUE(replies(next, "cap01"));
}

TEST_F(MemberCredentials, reject_all_messages_before_there_is_a_list) {
  Credentials fresh;
  fresh.set_studio_key(studio_key_, kNow);
  fresh.require_members();
  fresh.set_signing_key(cap01_);
  EXPECT_FALSE(fresh.is_complete());
  EXPECT_EQ(fresh.open_command(sign_message(command(), ada_), kNow).result, Result::kForged);
  wire::Bytes authenticated = command();
  studio_key_.add_mac(authenticated);
  EXPECT_EQ(fresh.open_command(authenticated, kNow).result, Result::kForged);
  EXPECT_FALSE(fresh.open_reply(sign_message(reply("cap01"), cap01_), kNow));
}

TEST_F(MemberCredentials, sign_sent_messages) {
  credentials_.set_signing_key(cap01_);
  EXPECT_TRUE(credentials_.open_reply(credentials_.authenticate(reply("cap01"), kNow), kNow));
  EXPECT_FALSE(credentials_.open_reply(credentials_.authenticate(reply("recon01"), kNow), kNow));
  credentials_.set_signing_key(guest_);
  EXPECT_FALSE(credentials_.open_reply(credentials_.authenticate(reply("cap01"), kNow), kNow));
}

TEST(Credentials, use_the_studio_key_without_a_member_list) {
  const wire::StudioKey key = wire::StudioKey::make();
  Credentials credentials;
  EXPECT_FALSE(credentials.is_complete());
  credentials.set_studio_key(key, kNow);
  EXPECT_TRUE(credentials.is_complete());
  const wire::Bytes authenticated = credentials.authenticate(encode(wire::ReplyMessage{}), kNow);
  EXPECT_EQ(authenticated, encode_with_mac(wire::ReplyMessage{}, key))
      << "same bytes as encode_with_mac()";
  EXPECT_TRUE(credentials.open_reply(authenticated, kNow));
  EXPECT_FALSE(
      credentials.open_reply(encode_with_mac(wire::ReplyMessage{}, wire::StudioKey::make()), kNow));
  EXPECT_EQ(credentials
                .open_command(
                    sign_message(encode(wire::CommandMessage{}), wire::SigningKey::make()), kNow)
                .result,
            Result::kForged);
}

}  // namespace
}  // namespace v3d::bus
