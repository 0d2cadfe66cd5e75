#include "tools/gliding_take.h"

#include <string>
#include <vector>

#include "base/config/calib_file.h"
#include "base/io/file.h"
#include "codec/frame_codec.h"
#include "codec/motion_codec.h"
#include "recon/figures.h"
#include "recon/pipeline/compact_frame.h"
#include "support/temporary_folder.h"
#include "take/logs/mesh_file.h"
#include "take/take.h"
#include "tools/test_images.h"

namespace v3d::test {

void write_gliding_motion(const std::filesystem::path& file, int first, int last) {
  std::vector<int64_t> pulses;
  for (int pulse = first; pulse < last; ++pulse) pulses.push_back(pulse);
  write_gliding_motion(file, {pulses});
}

void write_gliding_motion(const std::filesystem::path& file,
                          const std::vector<std::vector<int64_t>>& segments) {
  const Mesh person = recon::figures::surface(recon::figures::person(70, 50), 0.025);
  const std::vector<uint8_t> header = codec::MotionWriter::header();
  std::string bytes(header.begin(), header.end());
  codec::MotionWriter writer({});
  for (const std::vector<int64_t>& pulses : segments) {
    codec::MotionSegment segment;
    for (const auto& [a, b, c] : person.triangles) segment.triangles.push_back({a, b, c});
    segment.pulses = pulses;
    for (const int64_t pulse : pulses) {
      auto& positions = segment.positions.emplace_back();
      for (const Eigen::Vector3f& p : person.vertices) {
        positions.push_back({p.x() + 0.01F * static_cast<float>(pulse), p.y(), p.z()});
      }
    }
    const auto encoded = writer.add(segment);
    bytes.append(encoded->bytes.begin(), encoded->bytes.end());
  }
  write_text(file, bytes);
}

void write_still_meshes(const std::filesystem::path& take, const Mesh& surface,
                        const std::vector<uint8_t>& labels, int empty) {
  const VertexLattice lattice{{-2, -2, -1}, 1.0 / 1024};
  std::vector<uint32_t> number(surface.vertices.size(), UINT32_MAX);
  Mesh ordered;  // vertices in the order in which triangles use them
  std::vector<uint8_t> ordered_labels;
  std::vector<codec::VertexTriangle> triangles;
  for (const auto& corners : surface.triangles) {
    auto& triangle = triangles.emplace_back();
    for (size_t k = 0; k < 3; ++k) {
      uint32_t& v = number[corners[k]];
      if (v == UINT32_MAX) {
        v = static_cast<uint32_t>(ordered.vertices.size());
        ordered.vertices.push_back(rounded_to(lattice, surface.vertices[corners[k]]));
        if (!surface.colours.empty()) ordered.colours.push_back(surface.colours[corners[k]]);
        if (!labels.empty()) ordered_labels.push_back(labels[corners[k]]);
      }
      triangle[k] = v;
    }
  }
  const auto positions = recon::vertex_positions(ordered.vertices);
  const auto colours = recon::vertex_colours(ordered.colours);
  std::filesystem::remove(take::TakePaths{take}.mesh());
  take::MeshFileWriter file(take::TakePaths{take}.mesh());
  for (int pulse = 0; pulse < kGlidingPulses; ++pulse) {
    codec::FrameContent content;
    content.metadata.pulse = pulse;
    content.metadata.origin = {-2, -2, -1};
    content.metadata.step = lattice.step;
    if (pulse < kGlidingPulses - empty) {
      content.positions = positions;
      content.triangles = triangles;
      content.colours = colours;
      content.labels = ordered_labels;
    }
    io::throw_if_failed(file.append(pulse, codec::FrameEncoder({}).encode(content).value()));
  }
  io::throw_if_failed(file.close());
}

void write_gliding_take(const std::filesystem::path& take, double rate_hz) {
  std::filesystem::create_directory(take);
  const Rig rig = small_rig(3);
  save_calib(take::TakePaths{take}.calib(), rig);
  take::TakeInfo info;
  info.name = take.filename().string();
  info.rate_hz = rate_hz;
  info.pulses = kGlidingPulses;
  for (const RigCamera& camera : rig) info.cameras.push_back(camera.name);
  io::throw_if_failed(take::save_take_info({take}, info));
  write_gliding_motion(take::TakePaths{take}.motion(), 0, kGlidingPulses);
}

}  // namespace v3d::test
