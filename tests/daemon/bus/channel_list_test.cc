#include "daemon/bus/channel_list.h"

#include <gtest/gtest.h>

#include "base/core/text.h"
#include "daemon/bus/datagram.h"
#include "wire/messages.h"

namespace v3d::bus {
namespace {

Studio studio() {
  Studio studio;
  studio.nodes = {{"cap01"}, {"recon01"}};
  studio.cameras.resize(1);
  studio.cameras[0].name = "cam01";
  return studio;
}

TEST(ChannelList, contains_exactly_the_channels_of_the_studio) {
  const ChannelList channels(studio());
  for (const char* name : {"V3D_COMMAND", "V3D_REPLY", "V3D_PULSE", "V3D_MESH", "V3D_EVENT",
                           "V3D_FRAME_cam01", "V3D_PREVIEW_cam01", "V3D_HEALTH_cap01",
                           "V3D_SHARD_recon01", "V3D_MESH_recon01", "V3D_FRAMEKEY_cap01"}) {
    EXPECT_NE(channels.find(name), nullptr) << name;
  }
  for (const char* name : {"", "V3D_COMMAND2", "V3D_FRAME_cam02", "V3D_FRAME_", "V3D_HEALTH_cam01",
                           "V3D_FRAME_cap01", "V3D_FRAMEKEY_cam01", "LCM_SELF_TEST", "V3D_"}) {
    EXPECT_EQ(channels.find(name), nullptr) << name;
  }
}

TEST(ChannelList, has_names_that_fit_in_a_datagram_for_the_longest_cameras_and_nodes) {
  const std::string camera(kMaxCameraName, 'c'), node(kMaxNodeName, 'n');
  for (const std::string& name :
       {wire::frame_channel(camera), wire::preview_channel(camera), wire::frame_key_channel(node),
        wire::health_channel(node), wire::shard_channel(node), wire::shard_mesh_channel(node)}) {
    EXPECT_EQ(split_message(1, name, {}, false).size(), 1U) << name;
  }
}

TEST(ChannelList, returns_the_node_that_sends_on_a_channel) {
  Studio with_owners = studio();
  with_owners.cameras[0].node = "cap01";
  with_owners.trigger.node = "cap01";
  const ChannelList channels(with_owners);
  EXPECT_EQ(channels.owner_of("V3D_HEALTH_recon01"), "recon01");
  EXPECT_EQ(channels.owner_of("V3D_SHARD_recon01"), "recon01");
  EXPECT_EQ(channels.owner_of("V3D_MESH_recon01"), "recon01");
  EXPECT_EQ(channels.owner_of("V3D_PREVIEW_cam01"), "cap01");
  EXPECT_EQ(channels.owner_of("V3D_FRAMEKEY_recon01"), "recon01");
  EXPECT_EQ(channels.owner_of("V3D_FRAME_cam01"), "cap01");
  EXPECT_EQ(channels.owner_of("V3D_PULSE"), "cap01");
  for (const char* name : {"V3D_EVENT", "V3D_MESH", "V3D_HEALTH_cap09", "LCM_SELF_TEST"}) {
    EXPECT_EQ(channels.owner_of(name), "") << name;
  }
  EXPECT_EQ(ChannelList().owner_of("V3D_HEALTH_cap01"), "cap01");
  EXPECT_EQ(ChannelList().owner_of("V3D_PREVIEW_cam01"), "") << "needs the studio file";
}

TEST(ChannelList, accepts_a_limited_number_of_well_formed_names_without_a_studio) {
  ChannelList channels;
  EXPECT_NE(channels.find("V3D_FRAME_cam77"), nullptr);
  EXPECT_EQ(channels.find("V3D_FRAME_../etc"), nullptr);
  EXPECT_EQ(channels.find("OTHER_cam77"), nullptr);
  for (size_t i = 0; i < ChannelList::kMaxNames; ++i) {
    EXPECT_TRUE(channels.use("V3D_FRAME_cam" + std::to_string(i)));
  }
  EXPECT_FALSE(channels.use("V3D_FRAME_another"));
  EXPECT_TRUE(channels.use("V3D_FRAME_cam0")) << "already in use";
}

TEST(ChannelList, has_smaller_limits_for_short_messages) {
  const ChannelList channels;
  EXPECT_LE(channels.find("V3D_PULSE")->max_bytes, 4096U);
  EXPECT_LE(channels.find("V3D_COMMAND")->max_bytes, 16'384U);
  EXPECT_GE(channels.find("V3D_FRAME_cam01")->max_bytes, 12'000'000U) << "raw, 12 megapixels";
}

}  // namespace
}  // namespace v3d::bus
