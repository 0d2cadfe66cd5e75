#include "daemon/bus/credential_files.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include "base/io/file.h"
#include "support/temporary_folder.h"

namespace v3d::bus {
namespace {

using namespace std::chrono_literals;
using testing::AllOf;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::StartsWith;

constexpr MonotonicInstant kNow = from_ns<Monotonic>(3'600'000'000'000);

class KeyFile : public testing::Test {
 protected:
  /// Replaces the file atomically.
  wire::StudioKey replace_key() const {
    const wire::StudioKey key = wire::StudioKey::make();
    key.save(folder_ / "new.key");
    std::filesystem::rename(folder_ / "new.key", path_);
    return key;
  }
  bool accepts(const wire::StudioKey& key, MonotonicInstant now) const {
    return credentials_.open_command(encode_with_mac(wire::CommandMessage{}, key), now).result ==
           OpenedCommand::Result::kAccepted;
  }

  const test::TemporaryFolder folder_;
  const std::filesystem::path path_ = folder_ / "studio.key";
  Credentials credentials_;
  MessageAuthenticator authenticator_;
  CredentialFiles files_{{.studio = "kyoto", .studio_key = path_}, credentials_, authenticator_};
};

TEST_F(KeyFile, is_read_when_it_is_made_and_reported_as_missing_before) {
  EXPECT_THAT(files_.poll(kNow), HasSubstr("make it once with v3dctl key new"));
  EXPECT_THAT(files_.poll(kNow), IsEmpty()) << "it was reported already";
  EXPECT_FALSE(files_.is_ready());
  EXPECT_FALSE(authenticator_.is_required());
  const wire::StudioKey key = replace_key();
  EXPECT_THAT(files_.poll(kNow), HasSubstr("is readable again"));
  EXPECT_TRUE(files_.is_ready());
  EXPECT_THAT(files_.problem(), IsEmpty());
  EXPECT_TRUE(accepts(key, kNow));
  EXPECT_NE(authenticator_.mac(kNow), nullptr);
}

TEST_F(KeyFile, is_replaced_while_the_process_runs) {
  const wire::StudioKey first = replace_key();
  files_.poll(kNow);
  const auto first_mac = authenticator_.mac(kNow);
  const wire::StudioKey second = replace_key();
  EXPECT_FALSE(accepts(second, kNow));
  EXPECT_THAT(files_.poll(kNow + 1s), HasSubstr("a new studio key"));
  EXPECT_THAT(files_.poll(kNow + 2s), IsEmpty()) << "the same key";
  EXPECT_TRUE(accepts(second, kNow + 2s));
  EXPECT_TRUE(accepts(first, kNow + 2s));
  EXPECT_EQ(authenticator_.mac(kNow + 2s), first_mac);
  EXPECT_NE(authenticator_.mac(kNow + 11s), first_mac);
  EXPECT_TRUE(
      first.has_valid_mac(credentials_.authenticate(encode(wire::ReplyMessage{}), kNow + 2s)));
  EXPECT_TRUE(
      second.has_valid_mac(credentials_.authenticate(encode(wire::ReplyMessage{}), kNow + 11s)));
  EXPECT_FALSE(accepts(first, kNow + 21s));
  EXPECT_TRUE(accepts(second, kNow + 21s));
}

TEST_F(KeyFile, that_is_damaged_readable_for_others_or_missing_leaves_the_key_in_use) {
  const wire::StudioKey key = replace_key();
  files_.poll(kNow);
  const std::string text = read_file(path_);
  test::write_text(path_, text.substr(0, text.size() / 2));
  EXPECT_THAT(files_.poll(kNow), HasSubstr("64 hexadecimal digits"));
  EXPECT_THAT(files_.problem(), StartsWith("the previous studio key stays in use: "));
  test::write_text(path_, text);
  chmod(path_.c_str(), 0644);
  EXPECT_THAT(files_.poll(kNow), HasSubstr("chmod 640"));
  std::filesystem::remove(path_);
  EXPECT_THAT(files_.poll(kNow), HasSubstr("No such file or directory"));
  EXPECT_TRUE(files_.is_ready());
  EXPECT_TRUE(accepts(key, kNow + 1h));
  EXPECT_TRUE(
      key.has_valid_mac(credentials_.authenticate(encode(wire::ReplyMessage{}), kNow + 1h)));
}

/// The signing key of a capture node of a studio without a member list.
class SigningKeyFile : public KeyFile {
 protected:
  SigningKeyFile() { replace_key(); }

  CredentialFiles files_of(const std::string& node, wire::Role role) {
    return {{.studio = "kyoto",
             .studio_key = path_,
             .signing_key = signing_key_,
             .node = node,
             .role = role},
            credentials_,
            authenticator_};
  }
  wire::PublicKey replace_signing_key() const {
    const wire::SigningKey key = wire::SigningKey::make();
    key.save(folder_ / "next.key");
    std::filesystem::rename(folder_ / "next.key", signing_key_);
    return key.public_key();
  }

  const std::filesystem::path signing_key_ = folder_ / "node.key";
};

TEST_F(SigningKeyFile, is_read_when_it_is_made_or_replaced_without_a_restart) {
  CredentialFiles files = files_of("cap01", wire::Role::kCapture);
  EXPECT_THAT(files.poll(kNow), AllOf(StartsWith("takes are not signed: "),
                                      HasSubstr("make one on each PC with v3dctl key node")));
  EXPECT_TRUE(files.is_ready()) << "the node records takes without a signature";
  EXPECT_FALSE(files.signing_key().has_value());
  const wire::PublicKey first = replace_signing_key();
  EXPECT_THAT(files.poll(kNow), HasSubstr("the signing key is readable again"));
  EXPECT_EQ(files.signing_key().value().public_key(), first);
  EXPECT_THAT(files.problem(), IsEmpty());
  const wire::PublicKey second = replace_signing_key();
  EXPECT_THAT(files.poll(kNow), HasSubstr("node.key: a new signing key"));
  EXPECT_EQ(files.signing_key().value().public_key(), second);
  test::write_text(signing_key_, "damaged");
  EXPECT_THAT(files.poll(kNow), StartsWith("the previous signing key stays in use: "));
  EXPECT_EQ(files.signing_key().value().public_key(), second);
}

TEST_F(SigningKeyFile, is_not_read_by_processes_that_sign_nothing) {
  for (const auto& [node, role] :
       {std::pair("recon01", wire::Role::kReconstruction), std::pair("", wire::Role::kOperator)}) {
    CredentialFiles files = files_of(node, role);
    files.start_signing();
    EXPECT_THAT(files.poll(kNow), IsEmpty()) << node;
    EXPECT_THAT(files.problem(), IsEmpty()) << node;
  }
}

/// The files of a node of a studio with a member list.
class MemberFiles : public testing::Test {
 protected:
  MemberFiles() {
    wire::StudioKey::make().save(folder_ / "studio.key");
    cap01_.save(folder_ / "node.key");
    write(list());
    restart();
  }
  /// Reads the files as a process that has just started.
  void restart(const std::string& serial_file = "accepted") {
    files_.emplace(CredentialPaths{.studio = "kyoto",
                                   .studio_key = folder_ / "studio.key",
                                   .members = path_,
                                   .authority = authority_.public_key().text(),
                                   .signing_key = folder_ / "node.key",
                                   .accepted_serial = folder_ / serial_file,
                                   .node = "cap01",
                                   .role = wire::Role::kCapture},
                   credentials_, authenticator_);
  }
  wire::MemberList list(int64_t serial = 5) const {
    return {.studio = "kyoto",
            .serial = serial,
            .members = {{"ada", wire::Role::kOperator, ada_.public_key()},
                        {"cap01", wire::Role::kCapture, cap01_.public_key()}}};
  }
  wire::MemberList without_ada(int64_t serial) const {
    wire::MemberList list = this->list(serial);
    list.members.erase(list.members.begin());
    return list;
  }
  void write(const wire::MemberList& list) const {
    test::write_text(path_, sign_member_list(list, authority_));
  }
  bool accepts_ada() const {
    const wire::Bytes bytes = sign_message(encode(wire::CommandMessage{}), ada_);
    return credentials_.open_command(bytes, kNow).result == OpenedCommand::Result::kAccepted;
  }
  bool is_accepted_as(const std::string& node) const {
    wire::ReplyMessage reply;
    reply.node = node;
    return credentials_.open_reply(credentials_.authenticate(encode(reply), kNow), kNow)
        .has_value();
  }

  const test::TemporaryFolder folder_;
  const std::filesystem::path path_ = folder_ / "members.toml";
  const wire::SigningKey authority_ = wire::SigningKey::make(), ada_ = wire::SigningKey::make(),
                         cap01_ = wire::SigningKey::make();
  Credentials credentials_;
  MessageAuthenticator authenticator_;
  std::optional<CredentialFiles> files_;
};

TEST_F(MemberFiles, make_a_node_accept_operators_and_sign_its_replies) {
  EXPECT_FALSE(accepts_ada());
  EXPECT_THAT(files_->poll(kNow), IsEmpty());
  EXPECT_TRUE(files_->is_ready());
  EXPECT_THAT(files_->problem(), IsEmpty());
  EXPECT_TRUE(accepts_ada());
  EXPECT_TRUE(is_accepted_as("cap01"));
  EXPECT_TRUE(authenticator_.members().are_required());
}

TEST_F(MemberFiles, revoke_and_enroll_members_while_the_process_runs) {
  files_->poll(kNow);
  write(without_ada(6));
  EXPECT_THAT(files_->poll(kNow), HasSubstr("member list 6 is in force"));
  EXPECT_FALSE(accepts_ada());
  write(list(7));
  EXPECT_THAT(files_->poll(kNow), HasSubstr("member list 7 is in force"));
  EXPECT_TRUE(accepts_ada());
}

TEST_F(MemberFiles, that_are_older_than_the_list_in_force_are_rejected) {
  files_->poll(kNow);
  write(without_ada(6));
  files_->poll(kNow);
  for (const int64_t serial : {5, 6}) {
    write(list(serial));
    EXPECT_THAT(files_->poll(kNow), AllOf(StartsWith("the previous member list stays in use: "),
                                          HasSubstr("expected more than 6, which is in force")));
    EXPECT_FALSE(accepts_ada()) << "restored by list " << serial;
    write(without_ada(6));
    files_->poll(kNow);
    EXPECT_THAT(files_->problem(), IsEmpty());
  }
}

TEST_F(MemberFiles, that_are_older_than_a_list_before_the_restart_are_rejected) {
  write(without_ada(6));
  files_->poll(kNow);
  restart();
  EXPECT_THAT(files_->poll(kNow), IsEmpty()) << "the same list";
  EXPECT_TRUE(files_->is_ready());
  write(list(5));
  restart();
  const std::string file = (folder_ / "accepted").string();
  EXPECT_THAT(files_->poll(kNow), AllOf(HasSubstr("members.toml: serial: expected at least 6"),
                                        HasSubstr(file), HasSubstr("found 5")));
  EXPECT_FALSE(files_->is_ready());
  write(without_ada(7));
  files_->poll(kNow);
  EXPECT_TRUE(files_->is_ready());
  restart();
  write(without_ada(6));
  EXPECT_THAT(files_->poll(kNow), HasSubstr("expected at least 7"));
}

TEST_F(MemberFiles, of_another_authority_begin_with_numbers_of_their_own) {
  files_->poll(kNow);
  std::string text = read_file(folder_ / "accepted");
  const std::string key = authority_.public_key().text();
  text.replace(text.find(key), key.size(), ada_.public_key().text());
  test::write_text(folder_ / "accepted", text);
  write(list(1));
  restart();
  EXPECT_THAT(files_->poll(kNow), IsEmpty());
  EXPECT_TRUE(files_->is_ready());
  EXPECT_THAT(read_file(folder_ / "accepted"), AllOf(HasSubstr(key), HasSubstr("serial = 1\n")));
}

TEST_F(MemberFiles, whose_number_cannot_be_saved_are_in_force_and_the_error_is_reported) {
  restart("no folder/accepted");
  EXPECT_THAT(files_->poll(kNow),
              AllOf(HasSubstr("no folder"), HasSubstr("would accept an older member list")));
  EXPECT_THAT(files_->poll(kNow), IsEmpty()) << "it was reported already";
  EXPECT_TRUE(files_->is_ready());
  EXPECT_TRUE(accepts_ada());
  EXPECT_THAT(files_->problem(), HasSubstr("no folder"));
  std::filesystem::create_directory(folder_ / "no folder");
  files_->poll(kNow);
  EXPECT_THAT(files_->problem(), IsEmpty());
  EXPECT_THAT(read_file(folder_ / "no folder/accepted"), HasSubstr("serial = 5\n"));
}

TEST_F(MemberFiles, are_in_force_when_the_saved_number_is_damaged_and_it_is_replaced) {
  for (const char* const text : {"serial = ", "studio = 'kyoto'\n", ""}) {
    test::write_text(folder_ / "accepted", text);
    restart();
    EXPECT_THAT(files_->poll(kNow), HasSubstr("accepted")) << text;
    EXPECT_TRUE(files_->is_ready());
    EXPECT_THAT(read_file(folder_ / "accepted"), HasSubstr("serial = 5\n"));
  }
}

TEST_F(MemberFiles, that_were_changed_or_are_missing_leave_the_list_in_force) {
  files_->poll(kNow);
  std::string text = sign_member_list(without_ada(6), authority_);
  text[text.size() / 2] ^= 1;
  test::write_text(path_, text);
  EXPECT_THAT(files_->poll(kNow), HasSubstr("members.toml"));
  EXPECT_TRUE(accepts_ada());
  test::write_text(path_, sign_member_list(without_ada(6), ada_));
  files_->poll(kNow);
  EXPECT_THAT(files_->problem(), HasSubstr("not signed by [network] authority"));
  EXPECT_TRUE(accepts_ada());
  std::filesystem::remove(path_);
  EXPECT_THAT(files_->poll(kNow), HasSubstr("No such file"));
  EXPECT_TRUE(accepts_ada());
  EXPECT_TRUE(files_->is_ready());
}

TEST_F(MemberFiles, without_a_list_make_a_node_reject_all_commands) {
  std::filesystem::remove(path_);
  EXPECT_THAT(files_->poll(kNow), HasSubstr("v3dctl key enroll makes it"));
  EXPECT_FALSE(files_->is_ready());
  EXPECT_FALSE(credentials_.is_complete());
  EXPECT_FALSE(accepts_ada());
}

TEST_F(MemberFiles, report_the_command_that_enrolls_a_node_whose_key_is_not_in_the_list) {
  const wire::SigningKey next = wire::SigningKey::make();
  std::filesystem::remove(folder_ / "node.key");
  next.save(folder_ / "node.key");
  EXPECT_THAT(files_->poll(kNow), HasSubstr("v3dctl key enroll cap01 --role capture --public-key " +
                                            next.public_key().text()));
  EXPECT_FALSE(is_accepted_as("cap01"));
  wire::MemberList both = list(6);
  both.members.push_back({"cap01", wire::Role::kCapture, next.public_key()});
  write(both);
  files_->poll(kNow);
  EXPECT_THAT(files_->problem(), IsEmpty());
  EXPECT_TRUE(is_accepted_as("cap01"));
}

TEST_F(MemberFiles, replace_the_signing_key_while_the_process_runs) {
  const wire::SigningKey next = wire::SigningKey::make();
  wire::MemberList both = list();
  both.members.push_back({"cap01", wire::Role::kCapture, next.public_key()});
  write(both);
  files_->poll(kNow);
  next.save(folder_ / "next.key");
  std::filesystem::rename(folder_ / "next.key", folder_ / "node.key");
  EXPECT_THAT(files_->poll(kNow), HasSubstr("a new signing key"));
  wire::MemberList later = list(6);
  later.members.back().key = next.public_key();
  write(later);
  files_->poll(kNow);
  EXPECT_TRUE(is_accepted_as("cap01"));
}

}  // namespace
}  // namespace v3d::bus
