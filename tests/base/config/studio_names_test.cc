// Names of cameras and nodes in studio files.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/config/studio_file.h"
#include "base/core/error.h"
#include "base/core/text.h"
#include "support/message_of.h"
#include "support/studio_text.h"

namespace v3d {
namespace {

using testing::HasSubstr;

std::string rejection(const std::string& text) {
  return test::message_of<InputError>([&] { parse_studio(text, "studio.toml"); });
}

TEST(StudioNames, of_cameras_and_nodes_have_room_in_the_channels_of_their_messages) {
  const std::string camera(kMaxCameraName, 'c'), node(kMaxNodeName, 'n');
  EXPECT_EQ(parse_studio(test::studio_text({{node, {camera}}}), "studio.toml").cameras[0].name,
            camera);
  EXPECT_THAT(rejection(test::studio_text({{node, {camera + "c"}}})),
              HasSubstr("camera.name: '" + camera + "c' has 52 characters; expected at most 51"));
  EXPECT_THAT(rejection(test::studio_text({{node + "n", {camera}}})),
              HasSubstr("node.name: '" + node + "n' has 51 characters; expected at most 50"));
}

TEST(StudioNames, of_recordings_of_earlier_versions_may_be_longer) {
  const std::string camera(64, 'c'), node(64, 'n');
  const Studio studio =
      parse_recorded_studio(test::studio_text({{node, {camera}}}), "kendo-07/studio.toml");
  EXPECT_EQ(studio.cameras[0].name, camera);
  EXPECT_EQ(studio.nodes[0].name, node);
}

}  // namespace
}  // namespace v3d
