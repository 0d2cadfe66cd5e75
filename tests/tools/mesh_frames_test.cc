#include "daemon/recorded/mesh_frames.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <vector>

#include "base/core/error.h"
#include "codec/frame_codec.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"
#include "take/logs/mesh_file.h"
#include "take/take.h"
#include "tools/gliding_take.h"

namespace v3d::recorded {
namespace {

using testing::HasSubstr;

/// A compact frame of one triangle. Its first vertex decodes to the origin of the lattice.
std::vector<uint8_t> triangle(int64_t pulse, double origin_x_m = 0) {
  const std::vector<codec::VertexPosition> positions{{0, 0, 0}, {0.5F, 0, 0}, {0, 0.25F, 0}};
  const std::vector<codec::VertexTriangle> triangles{{0, 1, 2}};
  codec::FrameContent content;
  content.metadata.pulse = pulse;
  content.metadata.origin = {origin_x_m, 0, 0};
  content.metadata.step = 4 * std::max(origin_x_m, 0.0625);
  content.positions = positions;
  content.triangles = triangles;
  return codec::FrameEncoder({}).encode(content).value();
}

/// A take whose mesh.v3d a test writes.
class MeshFramesOfATake : public testing::Test {
 protected:
  MeshFramesOfATake() { test::write_gliding_take(take_); }

  void write(int64_t pulse, const std::vector<uint8_t>& frame) {
    take::MeshFileWriter file(take::TakePaths{take_}.mesh());
    ASSERT_TRUE(file.append(pulse, frame));
    ASSERT_TRUE(file.close());
  }
  std::string rejection(int64_t pulse) {
    MeshFrames frames(take_);
    return test::message_of<InputError>([&] { frames.read(pulse); });
  }

  const test::TemporaryFolder folder_;
  const std::filesystem::path take_ = folder_ / "take";
};

TEST_F(MeshFramesOfATake, are_read_by_their_pulses) {
  write(5, triangle(5));
  EXPECT_EQ(MeshFrames(take_).read(5).mesh.vertices.size(), 3U);
}

TEST_F(MeshFramesOfATake, are_damaged_where_a_record_holds_the_frame_of_another_pulse) {
  write(5, triangle(9));
  EXPECT_THAT(rejection(5), HasSubstr("mesh.v3d: frame 5 is damaged"));
}

TEST_F(MeshFramesOfATake, are_damaged_where_a_position_is_infinite_or_far_from_any_studio) {
  for (const double metres : {1e39, 1e7}) {
    std::filesystem::remove(take::TakePaths{take_}.mesh());
    write(5, triangle(5, metres));
    EXPECT_THAT(rejection(5), HasSubstr("mesh.v3d: frame 5 is damaged")) << metres;
  }
}

}  // namespace
}  // namespace v3d::recorded
