#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>

#include "base/core/error.h"
#include "base/io/file.h"
#include "codec/byte_stream.h"
#include "recon/performers/blocks.h"
#include "recon/performers/performer_labeller.h"
#include "recon/pipeline/compact_frame.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"
#include "take/logs/mesh_file.h"
#include "take/take.h"
#include "v3dctl/reconstruct/take_revision.h"

namespace v3d::ctl {
namespace {

using recon::body_at;
using testing::ElementsAre;
using testing::HasSubstr;

/// Meshes of two bodies who walk towards each other, touch for ten pulses, and part again.
class TwoBodies : public testing::Test {
 protected:
  static constexpr int64_t kPulses = 40;

  static double distance_at(int64_t pulse) {
    const auto from_contact = static_cast<double>(std::max<int64_t>(0, std::abs(pulse - 20) - 5));
    return 0.3 + 0.06 * from_contact;
  }
  static recon::SparseVolume volume_at(int64_t pulse) {
    const double half = distance_at(pulse) / 2;
    return recon::volume_of({body_at(-half), body_at(half)});
  }

  void append(int64_t pulse, take::MeshFileWriter& file) { append(pulse, volume_at(pulse), file); }
  void append(int64_t pulse, const recon::SparseVolume& volume, take::MeshFileWriter& file,
              std::span<const uint8_t> labels = {},
              std::span<const codec::VertexPosition> positions = {}) {
    const recon::VoxelGrid& grid = volume.grid();
    const codec::BrickVolume bricks = volume.view();
    const std::vector<codec::VertexColour> colours(marching_cubes(volume).vertices.size(),
                                                   {9, 99, 200});
    codec::FrameContent content;
    content.metadata.pulse = pulse;
    content.metadata.origin = {grid.origin.x(), grid.origin.y(), grid.origin.z()};
    content.metadata.step = grid.voxel_m / 2;
    content.volume = &bricks;
    content.positions = positions;
    content.colours = colours;
    content.labels = labels;
    io::throw_if_failed(file.append(pulse, encoder_.encode(content).value()));
  }
  void make_take() {
    take::MeshFileWriter file(mesh());
    for (int64_t pulse = 0; pulse < kPulses; ++pulse) append(pulse, file);
    io::throw_if_failed(file.close());
  }
  PerformersReport label() const {
    return label_performers(
        folder_.path(), [](int64_t) {}, [] {});
  }
  std::filesystem::path mesh() const { return take::TakePaths{folder_.path()}.mesh(); }

  const test::TemporaryFolder folder_;
  codec::FrameEncoder encoder_{{.key_every = 10}};
};

TEST_F(TwoBodies, keep_their_labels_through_contact) {
  make_take();
  const PerformersReport report = label();
  EXPECT_EQ(report.frames, kPulses);
  EXPECT_EQ(report.undecodable, 0);
  EXPECT_EQ(report.unlabelled, 0);
  ASSERT_EQ(report.performers.size(), 2U);
  for (const PerformerPulses& performer : report.performers) {
    EXPECT_EQ(performer.pulses, kPulses);
    EXPECT_EQ(performer.last, kPulses - 1);
    EXPECT_GT(performer.mean_vertices, 1000);
  }
  take::MeshFileReader meshes(mesh());
  recon::CompactDecoder decoder;
  std::array<int, 2> of_sides{};
  for (const int64_t pulse : meshes.pulses()) {
    ASSERT_EQ(decoder.decode(meshes.read(pulse).value().value()), codec::DecodeStatus::kOk);
    const recon::CompactFrame frame = decoder.frame();
    for (size_t v = 0; v < frame.performers.size(); ++v) {
      const float x = frame.mesh.vertices[v].x();
      if (std::abs(x) < 0.05) continue;  // beside the border
      int& side = of_sides[x < 0 ? 0 : 1];
      if (side == 0) side = frame.performers[v];
      ASSERT_EQ(frame.performers[v], side) << "pulse " << pulse << " at x " << x;
    }
  }
  EXPECT_EQ(of_sides[0] + of_sides[1], 3) << "1 and 2";
}

TEST_F(TwoBodies, keep_positions_colours_and_labels_when_they_are_labelled_again) {
  make_take();
  take::MeshFileReader before(mesh());
  label();
  const std::string once = read_file(mesh());
  label();
  EXPECT_EQ(read_file(mesh()), once);
  take::MeshFileReader after(mesh());
  ASSERT_EQ(after.pulses(), before.pulses());
  recon::CompactDecoder old_meshes, new_meshes;
  for (const int64_t pulse : before.pulses()) {
    ASSERT_EQ(old_meshes.decode(before.read(pulse).value().value()), codec::DecodeStatus::kOk);
    ASSERT_EQ(new_meshes.decode(after.read(pulse).value().value()), codec::DecodeStatus::kOk);
    EXPECT_EQ(new_meshes.frame().mesh.vertices, old_meshes.frame().mesh.vertices);
    EXPECT_EQ(new_meshes.frame().mesh.colours, old_meshes.frame().mesh.colours);
  }
}

/// The volumes of a live take have the grid of its space, and some of its surfaces are deformed.
TEST_F(TwoBodies, have_the_bytes_of_meshes_that_were_labelled_live) {
  recon::PerformerLabeller labeller;
  take::MeshFileWriter file(mesh());
  for (int64_t pulse = 0; pulse < kPulses; ++pulse) {
    const recon::SparseVolume volume = volume_at(pulse);
    if (pulse % 9 == 4) {  // it could not be encoded
      labeller.label(pulse, recon::volume_of({body_at(1.2)}));
      labeller.undo();
      continue;
    }
    std::vector<codec::VertexPosition> positions;
    if (pulse % 4 < 2) {
      positions = recon::vertex_positions(marching_cubes(volume).vertices);
      positions.front()[2] += 0.003F;
    }
    append(pulse, volume, file, labeller.label(pulse, volume), positions);
  }
  io::throw_if_failed(file.close());
  const auto frames = [&] {
    take::MeshFileReader meshes(mesh());
    std::vector<std::vector<uint8_t>> all;
    for (const int64_t pulse : meshes.pulses()) all.push_back(meshes.read(pulse).value().value());
    return all;
  };
  const std::vector<std::vector<uint8_t>> live = frames();
  EXPECT_EQ(label().performers.size(), 2U);
  EXPECT_EQ(frames(), live);
}

TEST_F(TwoBodies, are_not_found_in_meshes_of_an_empty_stage) {
  take::MeshFileWriter file(mesh());
  for (const int64_t pulse : {0, 1}) append(pulse, recon::volume_of({}), file);
  io::throw_if_failed(file.close());
  const PerformersReport report = label();
  EXPECT_EQ(report.frames, 2);
  EXPECT_EQ(report.undecodable, 0);
  EXPECT_TRUE(report.performers.empty());
}

TEST_F(TwoBodies, skip_frames_that_cannot_be_decoded) {
  take::MeshFileWriter file(mesh());
  append(0, file);
  io::throw_if_failed(file.append(1, std::vector<uint8_t>(200, 7)));
  append(2, file);
  io::throw_if_failed(file.close());
  const PerformersReport report = label();
  EXPECT_EQ(report.frames, 3);
  EXPECT_EQ(report.undecodable, 1);
  take::MeshFileReader meshes(mesh());
  EXPECT_EQ(meshes.read(1).value(), std::vector<uint8_t>(200, 7)) << "as it was";
}

TEST_F(TwoBodies, keep_frames_whose_bytes_are_damaged_on_the_disk) {
  take::MeshFileWriter file(mesh());
  append(0, file);
  const std::vector<uint8_t> last(200, 7);
  io::throw_if_failed(file.append(1, last));
  io::throw_if_failed(file.close());
  std::string bytes = read_file(mesh());
  const size_t damaged = bytes.find(std::string(200, 7)) + 100;
  bytes[damaged] ^= 1;
  test::write_text(mesh(), bytes);
  const PerformersReport report = label();
  EXPECT_EQ(report.frames, 2);
  EXPECT_EQ(report.undecodable, 1);
  take::MeshFileReader meshes(mesh());
  EXPECT_THAT(meshes.pulses(), ElementsAre(0, 1));
  EXPECT_FALSE(meshes.read(1).value()) << "v3dctl verify still finds the damage";
  EXPECT_THAT(read_file(mesh()), HasSubstr(bytes.substr(damaged - 100, 200))) << "as it was";
}

TEST_F(TwoBodies, are_not_labelled_while_their_meshes_are_written) {
  const auto write_pulse = [&](int64_t pulse) {
    take::MeshFileWriter file(mesh(), take::LogOpening::kContinue);
    append(pulse, file);
    io::throw_if_failed(file.close());
  };
  write_pulse(0);
  const auto label_while_written = [&] {
    label_performers(
        folder_.path(), [&](int64_t) { write_pulse(1); }, [] {});
  };
  EXPECT_THAT(test::message_of<InputError>(label_while_written),
              HasSubstr("mesh.v3d: has changed meanwhile"));
  EXPECT_THAT(take::MeshFileReader(mesh()).pulses(), ElementsAre(0, 1));
}

TEST_F(TwoBodies, are_not_labelled_in_a_file_without_its_end) {
  make_take();
  std::filesystem::resize_file(mesh(), std::filesystem::file_size(mesh()) - 1);
  const std::string before = read_file(mesh());
  EXPECT_THAT(test::message_of<InputError>([&] { label(); }), HasSubstr("mesh.v3d: has no index"));
  EXPECT_EQ(read_file(mesh()), before) << "v3dctl verify still finds the loss";
}

TEST_F(TwoBodies, are_not_labelled_when_a_mesh_claims_too_large_a_space) {
  take::MeshFileWriter file(mesh());
  const recon::SparseVolume volume = volume_at(0);
  const codec::BrickVolume bricks = volume.view();
  codec::FrameContent content;
  content.metadata.step = 0.01;
  content.volume = &bricks;
  std::vector<uint8_t> frame = encoder_.encode(content).value();
  for (const size_t axis : {100, 102, 104}) frame[axis + 1] = 15;  // first brick 3840 or more
  const uint32_t checksum = codec::crc32(std::span(frame).subspan(16));
  std::memcpy(&frame[12], &checksum, sizeof checksum);
  io::throw_if_failed(file.append(0, frame));
  io::throw_if_failed(file.close());
  EXPECT_THAT(test::message_of<InputError>([&] { label(); }), HasSubstr("claim too large a space"));
}

TEST_F(TwoBodies, are_not_labelled_without_meshes_of_volumes) {
  take::MeshFileWriter file(mesh());
  io::throw_if_failed(file.append(0, std::vector<uint8_t>(200, 7)));
  io::throw_if_failed(file.close());
  const std::string before = read_file(mesh());
  EXPECT_THAT(test::message_of<InputError>([&] { label(); }), HasSubstr("has no mesh of a volume"));
  EXPECT_EQ(read_file(mesh()), before);
}

}  // namespace
}  // namespace v3d::ctl
