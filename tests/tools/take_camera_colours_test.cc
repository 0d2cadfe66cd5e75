#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/core/error.h"
#include "base/io/file.h"
#include "recon/hull/sparse_volume.h"
#include "recon/performers/blocks.h"
#include "recon/pipeline/compact_frame.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"
#include "take/logs/mesh_file.h"
#include "take/take.h"
#include "v3dctl/reconstruct/take_revision.h"

namespace v3d::ctl {
namespace {

std::vector<uint8_t> encoded(codec::FrameEncoder& encoder, int64_t pulse,
                             const std::vector<recon::Block>& blocks) {
  const recon::SparseVolume volume = recon::volume_of(blocks);
  const codec::BrickVolume bricks = volume.view();
  const std::vector<codec::VertexColour> colours(marching_cubes(volume).vertices.size(),
                                                 {9, 99, 200});
  codec::FrameContent content;
  content.metadata.pulse = pulse;
  content.metadata.step = volume.grid().voxel_m / 2;
  content.volume = &bricks;
  content.colours = colours;
  return encoder.encode(content).value();
}

TEST(CameraColours, are_not_missed_at_a_pulse_without_a_surface) {
  const test::TemporaryFolder folder;
  codec::FrameEncoder encoder({});
  take::MeshFileWriter file(take::TakePaths{folder.path()}.mesh());
  io::throw_if_failed(file.append(0, encoded(encoder, 0, {})));
  io::throw_if_failed(file.append(1, encoded(encoder, 1, {recon::body_at(0)})));
  io::throw_if_failed(file.close());
  const CameraColourReport report = add_camera_colours(
      folder.path(), 0, [](int64_t) {}, [] {});
  EXPECT_EQ(report.frames, 2);
  EXPECT_EQ(report.undecodable, 0);
  EXPECT_EQ(report.without, 1) << "the body, of which there are no raw frames";
}

TEST(CameraColours, are_not_removed_from_a_file_without_its_end) {
  const test::TemporaryFolder folder;
  const std::filesystem::path mesh = take::TakePaths{folder.path()}.mesh();
  codec::FrameEncoder encoder({});
  take::MeshFileWriter file(mesh);
  io::throw_if_failed(file.append(0, encoded(encoder, 0, {recon::body_at(0)})));
  io::throw_if_failed(file.close());
  std::filesystem::resize_file(mesh, std::filesystem::file_size(mesh) - 1);
  const std::string before = read_file(mesh);
  const auto remove_colours = [&] {
    add_camera_colours(
        folder.path(), 0, [](int64_t) {}, [] {});
  };
  EXPECT_THAT(test::message_of<InputError>(remove_colours),
              testing::HasSubstr("mesh.v3d: has no index"));
  EXPECT_EQ(read_file(mesh), before) << "v3dctl verify still finds the loss";
}

}  // namespace
}  // namespace v3d::ctl
