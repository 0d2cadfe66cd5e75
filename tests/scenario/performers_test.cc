// Scenario test of live labels: two performers fight while a take is recorded.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <set>

#include "codec/frame_codec.h"
#include "recon/pipeline/compact_frame.h"
#include "studio4.h"
#include "take/logs/mesh_file.h"

namespace v3d {
namespace {

using testing::IsSupersetOf;

class DuelStudio8 : public test::Studio4 {
 protected:
  DuelStudio8()
      : Studio4({.cameras = 8,
                 .more = "performers = true\n",
                 .rate = "5",
                 .simulator = {"--performers", "2"}}) {}

  /// The performers that the vertices of the meshes are labelled with, 0: none.
  static std::set<int> performers_in(take::MeshFileReader& meshes) {
    std::set<int> performers;
    recon::CompactDecoder decoder;
    for (const int64_t pulse : meshes.pulses()) {
      const auto compact = meshes.read(pulse).value();
      if (!compact || decoder.decode(*compact) != codec::DecodeStatus::kOk) {
        ADD_FAILURE() << "pulse " << pulse << " is damaged";
        continue;
      }
      const std::vector<uint8_t> labels = decoder.frame().performers;
      EXPECT_EQ(labels.size(), decoder.frame().mesh.vertices.size()) << "pulse " << pulse;
      performers.insert(labels.begin(), labels.end());
    }
    return performers;
  }
};

TEST_F(DuelStudio8, labels_live_meshes_to_the_bytes_of_v3dctl_performers) {
  arm_and_start(0);
  ASSERT_TRUE(reaches("recon01", "performers", 2)) << log();
  ASSERT_TRUE(reaches("recon01", "meshes", 20)) << log();
  const control::Answer stopped = command(wire::CommandVerb::kStop);
  ASSERT_TRUE(stopped.done()) << text_of(stopped) << log();
  const auto recon = nlohmann::json::parse(stopped.replies.at("recon01").detail);
  EXPECT_TRUE(recon.contains("performers")) << recon;

  take::MeshFileReader live(take().mesh());
  EXPECT_THAT(performers_in(live), IsSupersetOf({1, 2}));
  const take::TakePaths copy{folder_ / "labelled"};
  std::filesystem::copy(take().folder, copy.folder, std::filesystem::copy_options::recursive);
  run_v3dctl({"performers", copy.folder}, 0);
  take::MeshFileReader labelled(copy.mesh());
  ASSERT_EQ(labelled.pulses(), live.pulses());
  for (const int64_t pulse : live.pulses()) {
    EXPECT_EQ(live.read(pulse).value(), labelled.read(pulse).value()) << "pulse " << pulse;
  }
}

}  // namespace
}  // namespace v3d
