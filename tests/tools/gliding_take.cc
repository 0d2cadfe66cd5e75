#include "tools/gliding_take.h"

#include <string>
#include <vector>

#include "base/config/calib_file.h"
#include "base/io/file.h"
#include "codec/motion_codec.h"
#include "recon/figures.h"
#include "support/temporary_folder.h"
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
