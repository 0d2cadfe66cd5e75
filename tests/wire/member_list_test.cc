#include "wire/member_list.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/core/error.h"
#include "support/message_of.h"
#include "wire/signatures.h"

namespace v3d::wire {
namespace {

using testing::ElementsAreArray;
using testing::HasSubstr;
using testing::IsEmpty;

class Members : public testing::Test {
 protected:
  MemberList list() const {
    return {.studio = "kyoto",
            .serial = 7,
            .members = {{"ada", Role::kOperator, ada_.public_key()},
                        {"cap01", Role::kCapture, cap01_.public_key()},
                        {"recon01", Role::kReconstruction, cap01_.public_key()},
                        {"guest", Role::kViewer, guest_.public_key()}}};
  }
  MemberList parse(const std::string& text) const {
    return parse_member_list(text, "members.toml", authority_.public_key(), "kyoto");
  }
  std::string error_of(const std::string& text) const {
    return test::message_of<InputError>([&] { parse(text); });
  }
  /// The error for a list with this text that the authority signed.
  std::string error_of_signed(const std::string& text) const {
    return error_of(sign_text(text, authority_));
  }
  static std::vector<std::string> names(const std::vector<const Member*>& members) {
    std::vector<std::string> names;
    for (const Member* member : members) names.push_back(member->name);
    return names;
  }

  const SigningKey authority_ = SigningKey::make();
  const SigningKey ada_ = SigningKey::make(), cap01_ = SigningKey::make(),
                   guest_ = SigningKey::make();
};

TEST_F(Members, are_read_as_they_were_signed) {
  const MemberList read = parse(sign_member_list(list(), authority_));
  EXPECT_EQ(read.studio, "kyoto");
  EXPECT_EQ(read.serial, 7);
  EXPECT_THAT(read.members, ElementsAreArray(list().members));
}

TEST_F(Members, are_rejected_with_any_changed_byte) {
  const std::string text = sign_member_list(list(), authority_);
  for (size_t i = 0; i < text.size(); ++i) {
    std::string changed = text;
    changed[i] = static_cast<char>(changed[i] ^ 1);
    EXPECT_THAT(error_of(changed), HasSubstr("members.toml")) << "byte " << i;
  }
  for (size_t size = 0; size < text.size(); ++size) {
    EXPECT_THAT(error_of(text.substr(0, size)), HasSubstr("members.toml")) << size << " bytes";
  }
}

TEST_F(Members, are_rejected_when_another_authority_signed_them) {
  EXPECT_THAT(error_of(sign_member_list(list(), SigningKey::make())),
              HasSubstr("not signed by [network] authority"));
  EXPECT_THAT(error_of(sign_member_list(list(), ada_)), HasSubstr("not signed by"));
}

TEST_F(Members, of_another_studio_are_rejected) {
  MemberList other = list();
  other.studio = "osaka";
  EXPECT_THAT(error_of(sign_member_list(other, authority_)),
              HasSubstr("studio: expected 'kyoto', as in the studio file"));
}

TEST_F(Members, are_rejected_with_file_and_field_of_an_invalid_entry) {
  const std::string head = "kind = 'v3d member list, version 1'\nstudio = 'kyoto'\n";
  const std::string key(64, '7');
  const auto entry = [&](const std::string& name, const std::string& role) {
    return "[[member]]\nname = '" + name + "'\nrole = '" + role + "'\npublic_key = '" + key + "'\n";
  };
  EXPECT_THAT(error_of_signed(head + "serial = 0\n"), HasSubstr("serial: expected 1 or more"));
  EXPECT_THAT(error_of_signed("kind = 'x'\n"), HasSubstr("kind: expected"));
  const std::string one = head + "serial = 1\n";
  EXPECT_THAT(error_of_signed(one + entry("ada", "king")),
              HasSubstr("role: expected one of operator, capture, reconstruction, viewer"));
  EXPECT_THAT(error_of_signed(one + entry("../ada", "operator")), HasSubstr("name: use letters"));
  EXPECT_THAT(error_of_signed(one + entry("ada", "operator") + entry("ada", "viewer")),
              HasSubstr("role: an earlier entry gives this member another role"));
  EXPECT_THAT(error_of_signed(one + entry("ada", "operator") + entry("ada", "operator")),
              HasSubstr("public_key: an earlier entry gives this member the same key"));
  EXPECT_THAT(error_of_signed(one + entry("ada", "operator") + "email = 'x'\n"),
              HasSubstr("email"));
}

TEST_F(Members, are_found_by_the_key_that_signed_a_message) {
  const Bytes message = encode(ReplyMessage{});
  const auto signers = [&](const SigningKey& key) {
    const Bytes bytes = sign_message(message, key);
    return names(list().signers_of(*split_signature(bytes)));
  };
  EXPECT_THAT(signers(ada_), testing::ElementsAre("ada"));
  EXPECT_THAT(signers(cap01_), testing::ElementsAre("cap01", "recon01")) << "they share a key";
  EXPECT_THAT(signers(SigningKey::make()), IsEmpty());
}

TEST_F(Members, are_not_found_by_a_signature_with_any_changed_bit) {
  const MemberList members = list();
  const Bytes bytes = sign_message(encode(ReplyMessage{}), ada_);
  for (size_t bit = 0; bit < 8 * bytes.size(); ++bit) {
    Bytes changed = bytes;
    changed[bit / 8] ^= static_cast<uint8_t>(1 << bit % 8);
    const auto split = split_signature(changed);
    if (!split) continue;
    EXPECT_THAT(members.signers_of(*split), IsEmpty()) << "bit " << bit;
  }
}

TEST(SignedMessage, splits_a_message_and_its_signature) {
  const SigningKey key = SigningKey::make();
  const Bytes message = encode(
      CommandMessage{.sent = {}, .sender = "ada", .take = {}, .allow_missing = {}, .to = {}});
  const Bytes bytes = sign_message(message, key);
  EXPECT_EQ(bytes.size(), message.size() + kMessageSignatureSize);
  const auto split = split_signature(bytes);
  ASSERT_TRUE(split);
  EXPECT_THAT(split->message, ElementsAreArray(message));
  EXPECT_TRUE(split->is_signed_by(key.public_key()));
  EXPECT_FALSE(split->is_signed_by(SigningKey::make().public_key()));
  EXPECT_FALSE(split_signature(message));
  EXPECT_FALSE(split_signature(std::span(bytes).last(kMessageSignatureSize)))
      << "signature without a message";
  EXPECT_FALSE(split_signature({}));
}

}  // namespace
}  // namespace v3d::wire
