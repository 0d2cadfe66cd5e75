#include "pulses.h"

#include <cmath>

#include "recon/hull/sparse_volume.h"
#include "recon/texture/texture.h"
#include "sim/rendering/camera_images.h"
#include "workload.h"

namespace v3d::bench {
namespace {

constexpr double kVoxelM = 0.01;

recon::FrameSet shoot(sim::BatchRenderer& film, int pulse) {
  const std::vector<Image> images =
      film.render_all(kInstantSeconds + pulse / 25.0, kPlates + pulse);
  recon::FrameSet set;
  for (int c = 0; c < kCameras; ++c) {
    const Mask mask = segmentation::Segmenter(background_models()[c], {}).segment(images[c].view());
    set.frames.push_back(observe(rig()[c].name, {}, images[c].view(), mask));
  }
  return set;
}

Pulse make_pulse(const recon::FrameSet& set, bool deformed) {
  std::vector<const Mask*> masks;
  std::vector<recon::TextureCamera> colouring;
  std::vector<recon::DeformCamera> deforming;
  for (int c = 0; c < kCameras; ++c) {
    masks.push_back(&*set.frames[c].mask);
    colouring.push_back({&rig()[c].model, &set.frames[c]});
    deforming.push_back({&rig()[c].model, &set.frames[c]});
  }
  Pulse pulse;
  pulse.volume = intersector(kVoxelM).intersect(masks);
  pulse.mesh = marching_cubes(pulse.volume);
  if (deformed) {
    recon::DeformOptions options;
    options.voxel_m = kVoxelM;
    recon::Deformer(options).run(recon::SurfaceCameras(deforming, pulse.mesh, options.voxel_m),
                                 pulse.mesh);
    for (const auto& v : pulse.mesh.vertices) pulse.positions.push_back({v.x(), v.y(), v.z()});
  }
  pulse.mesh.colours = colour_vertices(pulse.mesh, colouring, {}).colours;
  for (const Rgb8 c : pulse.mesh.colours) pulse.colours.push_back({c.r, c.g, c.b});
  return pulse;
}

std::vector<Pulse> make_pulses(bool deformed) {
  sim::BatchRenderer film(rig(), {.seed = kSeed});
  std::vector<Pulse> pulses;
  for (int n = 0; n < kPulses; ++n) pulses.push_back(make_pulse(shoot(film, n), deformed));
  return pulses;
}

}  // namespace

const std::vector<Pulse>& live_pulses() {
  static const auto kMade = make_pulses(false);
  return kMade;
}
const std::vector<Pulse>& high_pulses() {
  static const auto kMade = make_pulses(true);
  return kMade;
}

codec::FrameContent content_of(const Pulse& pulse, const codec::BrickVolume& volume,
                               int64_t number) {
  const recon::VoxelGrid& grid = pulse.volume.grid();
  codec::FrameContent content;
  content.metadata.pulse = number;
  content.metadata.cameras = {rig()[0].name};
  content.metadata.origin = {grid.origin.x(), grid.origin.y(), grid.origin.z()};
  content.metadata.step = grid.voxel_m / 2;
  content.volume = &volume;
  content.positions = pulse.positions;
  content.colours = pulse.colours;
  return content;
}

std::vector<uint8_t> encode_pulse(codec::FrameEncoder& encoder, const Pulse& pulse,
                                  int64_t number) {
  const codec::BrickVolume volume = pulse.volume.view();
  return encoder.encode(content_of(pulse, volume, number)).value();
}

double psnr_db(const std::vector<codec::VertexColour>& a,
               const std::vector<codec::VertexColour>& b) {
  double sum = 0;
  for (size_t v = 0; v < a.size(); ++v) {
    for (int c = 0; c < 3; ++c) sum += (a[v][c] - b[v][c]) * (a[v][c] - b[v][c]);
  }
  return 10 * std::log10(255 * 255 * 3 * static_cast<double>(a.size()) / sum);
}

}  // namespace v3d::bench
