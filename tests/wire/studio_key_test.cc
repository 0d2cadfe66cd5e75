#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include "base/core/error.h"
#include "base/io/file.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"
#include "wire/secret_keys.h"

namespace v3d::wire {
namespace {

using testing::HasSubstr;

CommandMessage start() {
  CommandMessage m;
  m.sender = "anna@desk/1/2";
  m.counter = 3;
  m.verb = CommandVerb::kStart;
  m.take = "kendo-07";
  m.to = {"cap01"};
  return m;
}

TEST(StudioKey, accepts_its_own_mac) {
  const StudioKey key = StudioKey::make();
  EXPECT_TRUE(key.has_valid_mac(encode_with_mac(start(), key)));
  EXPECT_TRUE(decode<CommandMessage>(encode_with_mac(start(), key)));
  EXPECT_TRUE(key.has_valid_mac(encode_with_mac(ReplyMessage{}, key)));
}

TEST(StudioKey, rejects_a_message_without_mac_and_the_mac_of_another_key) {
  const StudioKey key = StudioKey::make();
  EXPECT_FALSE(key.has_valid_mac(encode(start())));
  EXPECT_FALSE(key.has_valid_mac(encode_with_mac(start(), StudioKey::make())));
  EXPECT_FALSE(key.has_valid_mac({}));
  EXPECT_FALSE(key.has_valid_mac(Bytes(kCommandMacSize)));
}

TEST(StudioKey, rejects_any_changed_bit_and_any_truncation) {
  const StudioKey key = StudioKey::make();
  const Bytes authenticated = encode_with_mac(start(), key);
  for (size_t bit = 0; bit < 8 * authenticated.size(); ++bit) {
    Bytes changed = authenticated;
    changed[bit / 8] ^= static_cast<uint8_t>(1 << bit % 8);
    EXPECT_FALSE(key.has_valid_mac(changed)) << "bit " << bit;
  }
  for (size_t size = 0; size < authenticated.size(); ++size) {
    EXPECT_FALSE(key.has_valid_mac(std::span(authenticated).first(size))) << size << " bytes";
  }
}

class StudioKeyFile : public testing::Test {
 protected:
  std::string load_error() {
    return test::message_of<InputError>([&] { StudioKey::load(path_); });
  }

  const test::TemporaryFolder folder_;
  const std::filesystem::path path_ = folder_ / "studio.key";
};

TEST_F(StudioKeyFile, is_loaded_as_the_key_that_was_saved) {
  const StudioKey key = StudioKey::make();
  key.save(path_);
  EXPECT_TRUE(StudioKey::load(path_).has_valid_mac(encode_with_mac(start(), key)));
}

TEST_F(StudioKeyFile, is_private_to_its_owner_and_never_overwritten) {
  StudioKey::make().save(path_, "there is no such group");
  struct stat state {};
  ASSERT_EQ(stat(path_.c_str(), &state), 0);
  EXPECT_EQ(state.st_mode & 0777U, 0600U);
  const std::string before = read_file(path_);
  EXPECT_THAT(test::message_of<InputError>([&] { StudioKey::make().save(path_); }),
              HasSubstr("File exists"));
  EXPECT_EQ(read_file(path_), before);
}

TEST_F(StudioKeyFile, is_rejected_when_others_than_owner_and_group_have_access) {
  StudioKey::make().save(path_);
  for (const mode_t good : {0400U, 0600U, 0440U, 0640U}) {
    chmod(path_.c_str(), good);
    EXPECT_NO_THROW(StudioKey::load(path_)) << std::oct << good;
  }
  for (const mode_t bad : {0644U, 0604U, 0602U, 0660U, 0641U}) {
    chmod(path_.c_str(), bad);
    EXPECT_THAT(load_error(), HasSubstr("chmod 640")) << std::oct << bad;
  }
}

TEST_F(StudioKeyFile, is_reported_as_missing_with_the_command_that_makes_it) {
  EXPECT_THAT(load_error(),
              HasSubstr("No such file or directory; make it once with v3dctl key new"));
}

TEST_F(StudioKeyFile, is_rejected_unless_it_holds_64_hexadecimal_digits) {
  const std::string digits(64, 'a');
  EXPECT_NO_THROW(StudioKey::parse("# remark\n" + digits + "\n", path_));
  EXPECT_NO_THROW(StudioKey::parse(digits, path_));
  const std::string g(64, 'g');
  for (const std::string& bad : {std::string(), std::string("#"), digits.substr(1), digits + "a", g,
                                 digits + "\n" + digits}) {
    EXPECT_THAT(test::message_of<InputError>([&] { StudioKey::parse(bad, path_); }),
                HasSubstr("64 hexadecimal digits"));
  }
}

}  // namespace
}  // namespace v3d::wire
