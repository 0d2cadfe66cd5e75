// usage: viewer_takes DIR: writes takes for the browser tests.
// DIR/takes/ball has 60 pulses; 30 to 32 have no mesh. It shows a ball of 40 cm diameter, one metre
// above the floor, green for 30 pulses and then blue. In DIR/takes/pair the same ball consists of
// two performers: 1 is its lower half, green, and 2 the upper half, blue. DIR/takes/empty has no
// meshes.
#include "base/config/calib_file.h"
#include "take/ledger/ledger.h"
#include "take/logs/mesh_file.h"
#include "take/take.h"
#include "tests/viewer/ball_frames.h"

namespace v3d {
namespace {

constexpr int64_t kPulses = 60;
constexpr int64_t kFirstMissing = 30;
constexpr int64_t kFirstBlue = 33;
constexpr codec::VertexColour kGreen{40, 200, 40}, kBlue{40, 40, 200};

Rig one_camera() {
  Eigen::Matrix3d matrix;
  matrix << 600, 0, 320, 0, 600, 240, 0, 0, 1;
  return {{.name = "cam01",
           .model = {{640, 480}, matrix, {}, look_at({0, -3, 1}, {0, 0, 1})},
           .colour = {}}};
}

void save_take(const std::filesystem::path& folder, int64_t pulses) {
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
  io::throw_if_failed(save_ledger(paths.ledger(), ledger));
  save_calib(paths.calib(), one_camera());
}

void save_meshes(const std::filesystem::path& path) {
  codec::Scene scene(codec::ball(20));
  codec::FrameEncoder encoder({.key_every = 10});
  take::MeshFileWriter file(path);
  for (int64_t pulse = 0; pulse < kPulses; ++pulse) {
    if (pulse >= kFirstMissing && pulse < kFirstBlue) continue;
    const codec::VertexColour colour = pulse < kFirstMissing ? kGreen : kBlue;
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

}  // namespace
}  // namespace v3d

int main(int /*argc*/, char** argv) {
  const std::filesystem::path takes = std::filesystem::path(argv[1]) / "takes";
  v3d::save_take(takes / "ball", v3d::kPulses);
  v3d::save_meshes(takes / "ball/mesh.v3d");
  v3d::save_take(takes / "pair", 1);
  v3d::save_pair(takes / "pair/mesh.v3d");
  v3d::save_take(takes / "empty", 0);
  return 0;
}
