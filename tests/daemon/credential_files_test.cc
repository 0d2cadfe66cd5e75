#include "daemon/credential_files.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include "base/file.h"
#include "support/temporary_folder.h"

namespace v3d {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::StartsWith;

constexpr MonotonicInstant kNow = from_ns<Monotonic>(3'600'000'000'000);

class KeyFile : public testing::Test {
 protected:
  /// As an administrator does it: the file is there as a whole.
  StudioKey replace_key() const {
    const StudioKey key = StudioKey::make();
    key.save(folder_ / "new.key");
    std::filesystem::rename(folder_ / "new.key", path_);
    return key;
  }
  bool accepts(const StudioKey& key, MonotonicInstant now) const {
    return credentials_.has_sealed(encode_sealed(CommandMessage{}, key), now);
  }

  const test::TemporaryFolder folder_;
  const std::filesystem::path path_ = folder_ / "studio.key";
  Credentials credentials_;
  MessageSeal seal_;
  CredentialFiles files_{path_, credentials_, seal_};
};

TEST_F(KeyFile, is_found_when_it_is_made_and_missed_until_then) {
  EXPECT_THAT(files_.poll(kNow), HasSubstr("make it once with v3dctl key new"));
  EXPECT_THAT(files_.poll(kNow), IsEmpty()) << "it was reported";
  EXPECT_FALSE(files_.is_ready());
  EXPECT_FALSE(seal_.is_required());
  const StudioKey key = replace_key();
  EXPECT_THAT(files_.poll(kNow), HasSubstr("is readable again"));
  EXPECT_TRUE(files_.is_ready());
  EXPECT_THAT(files_.problem(), IsEmpty());
  EXPECT_TRUE(accepts(key, kNow));
  EXPECT_NE(seal_.mac(kNow), nullptr);
}

TEST_F(KeyFile, is_replaced_while_the_process_runs) {
  const StudioKey first = replace_key();
  files_.poll(kNow);
  const auto first_mac = seal_.mac(kNow);
  const StudioKey second = replace_key();
  EXPECT_FALSE(accepts(second, kNow));
  EXPECT_THAT(files_.poll(kNow + 1s), HasSubstr("a new studio key"));
  EXPECT_THAT(files_.poll(kNow + 2s), IsEmpty()) << "the same key";
  EXPECT_TRUE(accepts(second, kNow + 2s));
  EXPECT_TRUE(accepts(first, kNow + 2s));
  EXPECT_EQ(seal_.mac(kNow + 2s), first_mac);
  EXPECT_NE(seal_.mac(kNow + 11s), first_mac);
  EXPECT_TRUE(first.has_sealed(credentials_.seal(encode(ReplyMessage{}), kNow + 2s)));
  EXPECT_TRUE(second.has_sealed(credentials_.seal(encode(ReplyMessage{}), kNow + 11s)));
  EXPECT_FALSE(accepts(first, kNow + 21s));
  EXPECT_TRUE(accepts(second, kNow + 21s));
}

TEST_F(KeyFile, that_is_damaged_readable_for_others_or_gone_leaves_the_key_in_use) {
  const StudioKey key = replace_key();
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
  EXPECT_TRUE(key.has_sealed(credentials_.seal(encode(ReplyMessage{}), kNow + 1h)));
}

}  // namespace
}  // namespace v3d
