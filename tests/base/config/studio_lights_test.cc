#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/config/studio_file.h"
#include "base/core/error.h"
#include "support/message_of.h"
#include "support/studio_text.h"

namespace v3d {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

/// A studio with the trigger on cap01, and these fields of [lights].
Studio read(const std::string& fields) {
  return parse_studio(
      test::studio_text({{"cap01", {"cam01"}}, {"recon01", {}}}) + "[lights]\n" + fields,
      "studio.toml");
}
std::string message_for(const std::string& fields) {
  return test::message_of<InputError>([&] { read(fields); });
}

TEST(StudioLights, are_absent_without_their_table) {
  EXPECT_FALSE(parse_studio(test::studio_text({{"cap01", {"cam01"}}}), "studio.toml").lights);
}

TEST(StudioLights, have_two_scenes_on_the_node_of_the_trigger) {
  const auto lights = read("work = [255, 0]\ntake = [1, 2]\n").lights;
  ASSERT_TRUE(lights);
  EXPECT_EQ(lights->node, "cap01");
  EXPECT_EQ(lights->universe, 1);
  EXPECT_EQ(lights->settle_ms, 500);
  EXPECT_THAT(lights->work, ElementsAre(255, 0));
  EXPECT_THAT(lights->take, ElementsAre(1, 2));
}

TEST(StudioLights, are_rejected_with_the_invalid_field) {
  const std::string work = "work = [255, 0]\n";
  EXPECT_THAT(message_for(work), HasSubstr("lights.take: missing"));
  EXPECT_THAT(message_for(work + "take = [1]"),
              HasSubstr("lights.take: expected as many channels as work has, 2, found 1"));
  EXPECT_THAT(message_for(work + "take = [1, 256]"),
              HasSubstr("lights.take: expected values from 0 to 255, found 256"));
  EXPECT_THAT(message_for("work = []\ntake = []"),
              HasSubstr("lights.work: expected the values of 1 to 512 DMX channels, found 0"));
  EXPECT_THAT(message_for(work + "take = [1, 2]\nnode = \"recon01\""),
              HasSubstr("lights.node: 'recon01' has neither a camera nor the trigger"));
}

}  // namespace
}  // namespace v3d
