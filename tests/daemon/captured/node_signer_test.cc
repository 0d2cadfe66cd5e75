#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/io/file.h"
#include "daemon/captured/take_signers.h"
#include "support/studio_text.h"
#include "support/temporary_folder.h"

namespace v3d::captured {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::IsEmpty;

class NodeSignerTest : public testing::Test {
 protected:
  /// Writes and reads a studio file that lists `key` for cap01.
  Studio studio_with(const wire::SigningKey& key) const {
    std::string text = test::studio_text({{"cap01", {"cam01"}}});
    const std::string name = "name = 'cap01'\n";
    text.insert(text.find(name) + name.size(), "public_key = '" + key.public_key().text() + "'\n");
    test::write_text(folder_ / "studio.toml", text);
    return load_studio(folder_ / "studio.toml");
  }

  const test::TemporaryFolder folder_;
  const wire::SigningKey first_ = wire::SigningKey::make(), second_ = wire::SigningKey::make();
};

TEST_F(NodeSignerTest, warns_of_a_key_until_the_studio_file_lists_it) {
  const Studio studio = studio_with(first_);
  NodeSigner signer(studio, "cap01");
  EXPECT_THAT(signer.warning(), IsEmpty()) << "without a key nothing is signed";
  signer.set_key(first_);
  EXPECT_THAT(signer.warning(), IsEmpty());
  signer.set_key(second_);
  EXPECT_THAT(signer.warning(), AllOf(HasSubstr("its public key is " + second_.public_key().text()),
                                      HasSubstr("studio.toml has another for node cap01")));
  test::write_text(studio.path, "name = ");
  EXPECT_THAT(signer.warning(), HasSubstr("has another")) << "the file is being written";
  studio_with(second_);
  EXPECT_THAT(signer.warning(), IsEmpty());
}

TEST_F(NodeSignerTest, does_not_warn_where_the_studio_file_lists_no_key) {
  test::write_text(folder_ / "studio.toml", test::studio_text({{"cap01", {"cam01"}}}));
  const Studio studio = load_studio(folder_ / "studio.toml");
  NodeSigner signer(studio, "cap01");
  signer.set_key(first_);
  EXPECT_THAT(signer.warning(), IsEmpty());
}

}  // namespace
}  // namespace v3d::captured
