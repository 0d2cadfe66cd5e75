// usage: viewer_takes DIR: writes takes for the browser tests.
// DIR/takes/ball has 60 pulses; 30 to 32 have no mesh. It shows a ball of 40 cm diameter, one metre
// above the floor, green for 30 pulses and then blue. In DIR/takes/pair the same ball consists of
// two performers: 1 is its lower half, green, and 2 the upper half, blue. DIR/takes/empty has no
// meshes. DIR/takes/moving has the meshes of the ball and a motion.v3d of two segments. From pulse
// 5 to 24 a ball moves sideways, red up to pulse 14 and then blue. From pulse 25 to 29 it is
// smaller and yellow. DIR/takes/person has no meshes but a motion.v3d: a grey person who glides
// along x for 40 pulses and raises and lowers the left arm twice. DIR/takes/sounding has the meshes
// of the ball and a sound that rises from 0.1 to 0.9 of full scale; its clock is 521 ppm fast.
// DIR/takes/coded has no meshes but a motion.v3d: from pulse 5 to 24 and from 27 to 36 a ball moves
// sideways, whose colour states its pulse (player_probe.mjs reads it). Its sound has a burst at the
// pulses 10, 20 and 30.
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

#include "base/config/calib_file.h"
#include "base/io/file.h"
#include "codec/motion_codec.h"
#include "take/ledger/ledger.h"
#include "take/logs/mesh_file.h"
#include "take/take.h"
#include "tests/recon/figures.h"
#include "tests/support/sounding_take.h"
#include "tests/viewer/ball_frames.h"

namespace v3d {
namespace {

constexpr int64_t kPulses = 60;
constexpr int64_t kFirstMissing = 30;
constexpr int64_t kFirstBlue = 33;
constexpr codec::VertexColour kGreen{40, 200, 40}, kBlue{40, 40, 200};
constexpr codec::VertexColour kRed{200, 40, 40}, kYellow{200, 200, 40}, kGrey{120, 120, 120};
constexpr int64_t kPersonPulses = 40;

Rig one_camera() {
  Eigen::Matrix3d matrix;
  matrix << 600, 0, 320, 0, 600, 240, 0, 0, 1;
  return {{.name = "cam01",
           .model = {{640, 480}, matrix, {}, look_at({0, -3, 1}, {0, 0, 1})},
           .colour = {}}};
}

void save_take(const std::filesystem::path& folder, int64_t pulses,
               const std::vector<take::SoundLedger>& sounds = {}) {
  std::filesystem::create_directories(folder);
  const take::TakePaths paths{folder};
  io::throw_if_failed(save_take_info(paths, {.name = folder.filename(),
                                             .studio = "dojo",
                                             .rate_hz = 25,
                                             .pulses = pulses,
                                             .state = take::TakeState::kComplete,
                                             .software_version = "test",
                                             .started = Realtime::now(),
                                             .cameras = {"cam01"}}));
  take::Ledger ledger;
  ledger.take = folder.filename();
  ledger.commanded = pulses;
  ledger.sounds = sounds;
  io::throw_if_failed(save_ledger(paths.ledger(), ledger));
  save_calib(paths.calib(), one_camera());
}

/// `only`: the colour of all pulses; otherwise green, then blue.
void save_meshes(const std::filesystem::path& path, std::optional<codec::VertexColour> only = {}) {
  codec::Scene scene(codec::ball(20));
  codec::FrameEncoder encoder({.key_every = 10});
  take::MeshFileWriter file(path);
  for (int64_t pulse = 0; pulse < kPulses; ++pulse) {
    if (pulse >= kFirstMissing && pulse < kFirstBlue) continue;
    const codec::VertexColour colour = only.value_or(pulse < kFirstMissing ? kGreen : kBlue);
    io::throw_if_failed(file.append(pulse, *encoder.encode(ball_frame(scene, pulse, colour))));
  }
  io::throw_if_failed(file.close());
}

void save_pair(const std::filesystem::path& path) {
  codec::Scene scene(codec::ball(20));
  codec::FrameContent content = ball_frame(scene, 0, kGreen);
  const recon::VoxelGrid& grid = scene.volume.grid();
  const double middle = grid.origin.z() + 25 * grid.voxel_m;
  std::vector<uint8_t> performers(scene.colours.size(), 1);
  for (size_t v = 0; v < performers.size(); ++v) {
    if (scene.mesh.vertices[v].z() < middle) continue;
    performers[v] = 2;
    scene.colours[v] = kBlue;
  }
  content.labels = performers;
  take::MeshFileWriter file(path);
  io::throw_if_failed(file.append(0, *codec::FrameEncoder({}).encode(content)));
  io::throw_if_failed(file.close());
}

/// A ball that moves sideways in the pulses [first, end).
codec::MotionSegment moving_ball(double radius_voxels, int64_t first, int64_t end) {
  const codec::Scene scene(codec::ball(radius_voxels));
  const recon::VoxelGrid& grid = scene.volume.grid();
  const Eigen::Vector3d middle = grid.origin + Eigen::Vector3d::Constant(25 * grid.voxel_m);
  codec::MotionSegment segment;
  segment.triangles = scene.mesh.triangles;
  for (int64_t pulse = first; pulse < end; ++pulse) {
    const Eigen::Vector3d at(0.1 * std::sin(0.3 * static_cast<double>(pulse)), 0, 1);
    segment.pulses.push_back(pulse);
    auto& positions = segment.positions.emplace_back();
    for (const auto& vertex : scene.mesh.vertices) {
      const Eigen::Vector3f moved = (vertex.cast<double>() - middle + at).cast<float>();
      positions.push_back({moved.x(), moved.y(), moved.z()});
    }
  }
  segment.key = segment.pulses.size() / 2;
  return segment;
}

void write_motion(const std::filesystem::path& path,
                  const std::vector<codec::MotionSegment>& segments) {
  codec::MotionWriter writer({.colour_steps = {1, 1, 1}});
  std::vector<uint8_t> bytes = codec::MotionWriter::header();
  for (const codec::MotionSegment& segment : segments) {
    const codec::EncodedMotion encoded = writer.add(segment).value();
    bytes.insert(bytes.end(), encoded.bytes.begin(), encoded.bytes.end());
  }
  io::throw_if_failed(io::replace_file(path, std::string(bytes.begin(), bytes.end())));
}

void save_motion(const std::filesystem::path& path) {
  codec::MotionSegment two_colours = moving_ball(20, 5, 25), one_colour = moving_ball(14, 25, 30);
  const size_t vertices = two_colours.positions[0].size();
  for (const int64_t pulse : two_colours.pulses)
    two_colours.colours.emplace_back(vertices, pulse < 15 ? kRed : kBlue);
  one_colour.colours.emplace_back(one_colour.positions[0].size(), kYellow);
  write_motion(path, {two_colours, one_colour});
}

/// The last three digits of a pulse to the base 4, from red to blue.
codec::VertexColour coded(int64_t pulse) {
  const auto value = [](int64_t digit) { return static_cast<uint8_t>(40 + 60 * (digit % 4)); };
  return {value(pulse / 16), value(pulse / 4), value(pulse)};
}

void save_coded_motion(const std::filesystem::path& path) {
  std::vector<codec::MotionSegment> segments{moving_ball(20, 5, 25), moving_ball(14, 27, 37)};
  for (codec::MotionSegment& segment : segments) {
    for (const int64_t pulse : segment.pulses) {
      segment.colours.emplace_back(segment.positions[0].size(), coded(pulse));
    }
  }
  write_motion(path, segments);
}

/// The position of a vertex of figures::person(70, 70) at a pulse: the left arm turns about the
/// shoulder, everything glides along x.
codec::VertexPosition moved_person(const Eigen::Vector3f& vertex, int64_t pulse) {
  constexpr double kPeriod = 20, kLargestTurn = 0.5, kGlideM = 0.01;
  const auto time = static_cast<double>(pulse);
  const Eigen::Vector3d shoulder(0, 0.185, 1.40);
  const Eigen::Vector3d position = vertex.cast<double>();
  const double in_arm = std::clamp((position.y() - 0.17) / 0.08, 0.0, 1.0);
  const double turn =
      position.z() < 1 ? 0
                       : 0.5 * kLargestTurn * (1 - std::cos(2 * std::numbers::pi * time / kPeriod));
  const Eigen::AngleAxisd raise(in_arm * turn, Eigen::Vector3d::UnitX());
  const Eigen::Vector3d moved = shoulder + raise * (position - shoulder);
  return {static_cast<float>(moved.x() + kGlideM * time), static_cast<float>(moved.y()),
          static_cast<float>(moved.z())};
}

void save_person(const std::filesystem::path& path) {
  const Mesh person = recon::figures::surface(recon::figures::person(70, 70), 0.02);
  codec::MotionSegment segment;
  for (const auto& [a, b, c] : person.triangles) segment.triangles.push_back({a, b, c});
  for (int64_t pulse = 0; pulse < kPersonPulses; ++pulse) {
    segment.pulses.push_back(pulse);
    auto& positions = segment.positions.emplace_back();
    for (const Eigen::Vector3f& vertex : person.vertices) {
      positions.push_back(moved_person(vertex, pulse));
    }
  }
  segment.colours.emplace_back(person.vertices.size(), kGrey);
  write_motion(path, {segment});
}

constexpr int64_t kSamples = 120'000;
constexpr double kFirstSample = 4800, kSamplesPerPulse = 1921;

take::SoundLedger save_sound(const take::TakePaths& paths, const test::Signal& signal) {
  const sound::PulseMap map{
      {{0, kFirstSample}, {kPulses, kFirstSample + kPulses * kSamplesPerPulse}}};
  return test::write_sound(paths, map, kSamples, 1, signal);
}

/// A ramp, so that the value of a sample is its position.
double ramp(int64_t sample, int /*channel*/) {
  return 0.1 + 0.8 * static_cast<double>(sample) / kSamples;
}

double bursts(int64_t sample, int /*channel*/) {
  double value = 0;
  for (const int pulse : {10, 20, 30}) {
    value += test::burst(static_cast<double>(sample), kFirstSample + pulse * kSamplesPerPulse);
  }
  return value;
}

}  // namespace
}  // namespace v3d

int main(int /*argc*/, char** argv) {
  const std::filesystem::path takes = std::filesystem::path(argv[1]) / "takes";
  v3d::save_take(takes / "ball", v3d::kPulses);
  v3d::save_meshes(takes / "ball/mesh.v3d");
  v3d::save_take(takes / "proxied", v3d::kPulses);
  v3d::save_meshes(takes / "proxied/mesh.v3d");
  v3d::save_meshes(takes / "proxied/proxy.v3d", v3d::kYellow);
  v3d::save_take(takes / "pair", 1);
  v3d::save_pair(takes / "pair/mesh.v3d");
  v3d::save_take(takes / "moving", v3d::kPulses);
  v3d::save_meshes(takes / "moving/mesh.v3d");
  v3d::save_motion(takes / "moving/motion.v3d");
  v3d::save_take(takes / "sounding", v3d::kPulses,
                 {v3d::save_sound({takes / "sounding"}, v3d::ramp)});
  v3d::save_meshes(takes / "sounding/mesh.v3d");
  v3d::save_take(takes / "empty", 0);
  v3d::save_take(takes / "coded", v3d::kPulses, {v3d::save_sound({takes / "coded"}, v3d::bursts)});
  v3d::save_coded_motion(takes / "coded/motion.v3d");
  v3d::save_take(takes / "person", v3d::kPersonPulses);
  v3d::save_person(takes / "person/motion.v3d");
  return 0;
}
