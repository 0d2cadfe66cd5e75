#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include "base/core/error.h"
#include "base/io/file.h"
#include "support/file_size_limit.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"
#include "wire/secret_keys.h"
#include "wire/signatures.h"

namespace v3d::wire {
namespace {

using testing::AllOf;
using testing::HasSubstr;

std::span<const uint8_t> bytes_of(std::string_view text) {
  return {reinterpret_cast<const uint8_t*>(text.data()), text.size()};
}

class SigningKeys : public testing::Test {
 protected:
  std::string load_error() const {
    return test::message_of<InputError>([&] { SigningKey::load(path_); });
  }
  void write_key(const std::string& text) const {
    test::write_text(path_, text);
    chmod(path_.c_str(), 0600);
  }

  const test::TemporaryFolder folder_;
  const std::filesystem::path path_ = folder_ / "node.key";
};

TEST_F(SigningKeys, make_signatures_that_only_their_public_key_verifies) {
  const SigningKey key = SigningKey::make();
  const Signature signature = key.sign(bytes_of("a take"));
  EXPECT_TRUE(key.public_key().has_signed(bytes_of("a take"), signature));
  EXPECT_FALSE(key.public_key().has_signed(bytes_of("a tape"), signature));
  EXPECT_FALSE(SigningKey::make().public_key().has_signed(bytes_of("a take"), signature));
}

TEST_F(SigningKeys, make_signatures_that_are_invalid_with_any_changed_bit) {
  const SigningKey key = SigningKey::make();
  const Signature signature = key.sign(bytes_of("a take"));
  for (size_t bit = 0; bit < 8 * signature.size(); ++bit) {
    Signature changed = signature;
    changed[bit / 8] ^= static_cast<uint8_t>(1U << bit % 8);
    EXPECT_FALSE(key.public_key().has_signed(bytes_of("a take"), changed)) << bit;
  }
}

TEST_F(SigningKeys, match_the_test_vector_of_rfc_8032) {
  // Section 7.1, test 2.
  write_key("4ccd089b28ff96da9db6c346ec114e0f5b8a319f35aba624da8cf6ed4fb8a6fb\n");
  const SigningKey key = SigningKey::load(path_);
  EXPECT_EQ(key.public_key().text(),
            "3d4017c3e843895a92b70aa74d1b7ebc9c982ccf2ec4968cc0cd55f12af4660c");
  EXPECT_EQ(hexadecimal(key.sign(bytes_of("r"))),
            "92a009a9f0d4cab8720e820b5f642540a2b27b5416503f8fb3762223ebdb69da"
            "085ac1e43e15996e458f3613d0f11d8c387b2eaeb4302aeeb00d291612bb0c00");
}

TEST_F(SigningKeys, are_saved_to_a_private_file_and_loaded_unchanged) {
  const SigningKey key = SigningKey::make();
  key.save(path_, "no such group");
  struct stat state {};
  ASSERT_EQ(stat(path_.c_str(), &state), 0);
  EXPECT_EQ(state.st_mode & 07777U, 0600U);
  EXPECT_EQ(SigningKey::load(path_).public_key(), key.public_key());
  EXPECT_THAT(test::message_of<InputError>([&] { key.save(path_); }),
              HasSubstr("cannot make the signing key " + path_.string()));
}

TEST_F(SigningKeys, that_a_full_disk_rejects_are_no_bad_input_and_leave_no_file) {
  const test::FileSizeLimit limit(8);
  try {
    SigningKey::make().save(path_);
    FAIL() << "the key was written";
  } catch (const InputError& error) {
    FAIL() << "the user can correct this: " << error.what();
  } catch (const std::runtime_error& error) {
    EXPECT_THAT(error.what(), HasSubstr("cannot write the signing key " + path_.string()));
  }
  EXPECT_FALSE(file_exists(path_));
}

TEST_F(SigningKeys, are_rejected_with_the_remedy) {
  EXPECT_THAT(load_error(), AllOf(HasSubstr("no signing key: " + path_.string()),
                                  HasSubstr("make one on each PC with v3dctl key node")));
  write_key("abc\n");
  EXPECT_THAT(load_error(), HasSubstr("expected a signing key of 64 hexadecimal digits"));
  write_key(std::string(64, 'a') + "\n");
  chmod(path_.c_str(), 0644);
  EXPECT_THAT(load_error(),
              HasSubstr("gives other users access to the signing key; run: chmod 640"));
}

TEST(PublicKey, is_parsed_only_from_64_hexadecimal_digits) {
  const PublicKey key = SigningKey::make().public_key();
  EXPECT_EQ(PublicKey::parse(key.text(), "here"), key);
  EXPECT_THAT(test::message_of<InputError>([] { PublicKey::parse("abc", "here"); }),
              HasSubstr("here: expected a public key of 64 hexadecimal digits"));
}

}  // namespace
}  // namespace v3d::wire
