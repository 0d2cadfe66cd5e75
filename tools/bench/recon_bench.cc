#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include "pulses.h"
#include "rates.h"
#include "recon/hull/ghost_removal.h"
#include "recon/hull/slender_silhouettes.h"
#include "recon/hull/sparse_volume.h"
#include "recon/metrics/frame_quality.h"
#include "recon/skeleton/reeb_graph.h"
#include "recon/surface/deform.h"
#include "recon/texture/texture.h"
#include "recon/visibility/depth_buffer.h"
#include "workload.h"

namespace v3d::bench {
namespace {

void intersect(benchmark::State& state, double voxel_m) {
  recon::Intersector hull = intersector(voxel_m);
  const std::vector<const Mask*> pointers = pointers_to(masks());
  tbb::task_arena arena(static_cast<int>(state.range(0)));
  recon::SparseVolume volume;
  measure(state, 1, 0, [&] {
    arena.execute([&] { hull.intersect(pointers, volume); });
    benchmark::DoNotOptimize(volume);
  });
}

/// The silhouettes of one instant, with a sword.
void widen_slender(benchmark::State& state, double voxel_m) {
  std::vector<recon::SlenderSilhouettes> slender;
  for (const RigCamera& camera : rig()) {
    const auto sizes = recon::SlenderSizes::for_camera(camera.model, space(), voxel_m);
    slender.emplace_back(camera.model.size(), sizes);
  }
  const std::vector<const Mask*> pointers = pointers_to(masks());
  tbb::task_arena arena(static_cast<int>(state.range(0)));
  measure(state, 1, 0, [&] {
    arena.execute([&] {
      tbb::parallel_for(size_t{0}, pointers.size(), [&](size_t c) {
        benchmark::DoNotOptimize(&slender[c].widen(*pointers[c]));
      });
    });
  });
}

/// A hull without ghosts: only its components are searched.
void remove_ghosts(benchmark::State& state, double voxel_m) {
  recon::SparseVolume hull = volume(voxel_m);
  const std::vector<CameraModel> cameras = models_of(rig());
  recon::GhostRemoval ghosts(hull.grid(), cameras);
  const std::vector<uint8_t> takes_part(cameras.size(), 1);
  ghosts.remove(hull, takes_part);
  measure(state, 1, 0, [&] { benchmark::DoNotOptimize(ghosts.remove(hull, takes_part)); });
}

void mesh(benchmark::State& state, double voxel_m) {
  const recon::SparseVolume occupied = volume(voxel_m);
  tbb::task_arena arena(1);
  recon::MarchingCubes marching_cubes;
  Mesh surface;
  measure(state, 1, 0, [&] {
    arena.execute([&] { marching_cubes.run(occupied, surface); });
    benchmark::DoNotOptimize(surface.triangles.data());
  });
}

BENCHMARK_CAPTURE(intersect, 16mm, 0.016)
    ->Name("intersect/16mm")
    ->ArgName("threads")
    ->Arg(1)
    ->Arg(2);
BENCHMARK_CAPTURE(intersect, 4mm, 0.004)->Name("intersect/4mm")->ArgName("threads")->Arg(1)->Arg(2);
BENCHMARK_CAPTURE(intersect, 8mm, 0.008)->Name("intersect/8mm")->ArgName("threads")->Arg(1)->Arg(2);
BENCHMARK_CAPTURE(intersect, 5mm, 0.005)->Name("intersect/5mm")->ArgName("threads")->Arg(1)->Arg(2);
BENCHMARK_CAPTURE(intersect, 2mm, 0.002)->Name("intersect/2mm")->ArgName("threads")->Arg(1)->Arg(2);
BENCHMARK_CAPTURE(widen_slender, 8mm, 0.008)
    ->Name("widen_slender/8mm")
    ->ArgName("threads")
    ->Arg(1)
    ->Arg(2);
BENCHMARK_CAPTURE(remove_ghosts, 10mm, 0.01)->Name("remove_ghosts/10mm");
BENCHMARK_CAPTURE(remove_ghosts, 5mm, 0.005)->Name("remove_ghosts/5mm");
BENCHMARK_CAPTURE(mesh, 8mm, 0.008)->Name("mesh/8mm");
BENCHMARK_CAPTURE(mesh, 5mm, 0.005)->Name("mesh/5mm");

}  // namespace

namespace {

const Mesh& mesh_10mm() {
  static const Mesh kMesh =
      recon::Reconstructor(rig(), options(0.01, 0)).reconstruct(frame_set()).mesh;
  return kMesh;
}

void texture(benchmark::State& state, int threads) {
  std::vector<recon::TextureCamera> cameras;
  for (int c = 0; c < kCameras; ++c) {
    cameras.push_back({&rig()[c].model, &frame_set().frames[c]});
  }
  const Mesh& mesh = mesh_10mm();
  tbb::task_arena arena(threads);
  measure(state, 1, 0, [&] {
    arena.execute([&] { benchmark::DoNotOptimize(colour_vertices(mesh, cameras, {})); });
  });
}

/// Measures the quality of a mesh against the silhouettes it was made from.
void score(benchmark::State& state) {
  const recon::QualityMeter meter(rig(), options(0.01, 0).bounds, 0.01);
  std::vector<const Frame*> frames;
  for (const Frame& frame : frame_set().frames) frames.push_back(&frame);
  const Mesh& mesh = mesh_10mm();
  tbb::task_arena arena(1);
  recon::FrameQuality quality;
  measure(state, 1, 0, [&] { arena.execute([&] { quality = meter.measure(mesh, frames); }); });
  state.counters["iou"] = quality.silhouette_iou;
  state.counters["coverage"] = quality.coverage;
}

/// Draws the depth buffers of the whole rig, reduced by `factor`.
void raster(benchmark::State& state, int factor) {
  std::vector<CameraModel> models;
  for (const CameraModel& camera : models_of(rig())) models.push_back(camera.reduced(factor));
  const Mesh& mesh = mesh_10mm();
  tbb::task_arena arena(1);
  std::vector<recon::DepthBuffer> buffers;
  measure(state, kCameras, 0, [&] {
    arena.execute([&] { draw_depths(mesh, models, buffers); });
    benchmark::DoNotOptimize(buffers.data());
  });
}

BENCHMARK_CAPTURE(texture, one, 1)->Name("texture/10mm");
BENCHMARK_CAPTURE(texture, two, 2)->Name("texture/10mm/threads:2");
BENCHMARK(score)->Name("score/10mm");
BENCHMARK_CAPTURE(raster, whole, 1)->Name("raster/depth_15xXGA");
BENCHMARK_CAPTURE(raster, half, 2)->Name("raster/depth_15xXGA/half");
BENCHMARK_CAPTURE(raster, quarter, 4)->Name("raster/depth_15xXGA/quarter");

}  // namespace

// Benchmark of the compact frame coder on consecutive pulses of the simulated performer, one core.

namespace {

/// Reports means over the pulses: one key frame and the frames after it.
void report_sizes(benchmark::State& state, const std::vector<Pulse>& pulses) {
  codec::FrameEncoder encoder({});
  double vertices = 0, triangles = 0, psnr = 0, between = 0;
  codec::FrameBytes sum;
  for (int n = 0; n < kPulses; ++n) {
    const auto bytes = static_cast<double>(encode_pulse(encoder, pulses[n], n).size());
    n == 0 ? void(state.counters["key_bytes"] = bytes) : void(between += bytes);
    const codec::FrameBytes parts = encoder.bytes();
    sum.shape += parts.shape;
    sum.displacements += parts.displacements;
    sum.colours += parts.colours;
    vertices += static_cast<double>(pulses[n].mesh.vertices.size());
    triangles += static_cast<double>(pulses[n].mesh.triangles.size());
    psnr += bench::psnr_db(encoder.decoded().colours, pulses[n].colours);
  }
  state.counters["frame_bytes"] = between / (kPulses - 1);
  state.counters["triangles"] = triangles / kPulses;
  state.counters["shape_bits"] = 8 * static_cast<double>(sum.shape) / vertices;
  state.counters["move_bits"] = 8 * static_cast<double>(sum.displacements) / vertices;
  state.counters["colour_bits"] = 8 * static_cast<double>(sum.colours) / vertices;
  state.counters["psnr_db"] = psnr / kPulses;
}

void encode(benchmark::State& state, const std::vector<Pulse>& (*made)()) {
  const std::vector<Pulse>& pulses = made();
  codec::FrameEncoder encoder({});
  int64_t number = 0;
  measure(state, kPulses, 0, [&] {
    for (const Pulse& pulse : pulses) {
      benchmark::DoNotOptimize(encode_pulse(encoder, pulse, number++));
    }
  });
  report_sizes(state, pulses);
}

void decode(benchmark::State& state, const std::vector<Pulse>& (*pulses)()) {
  codec::FrameEncoder encoder({});
  std::vector<std::vector<uint8_t>> frames;
  double bytes = 0;
  for (int n = 0; n < kPulses; ++n) {
    frames.push_back(encode_pulse(encoder, pulses()[n], n));
    bytes += static_cast<double>(frames.back().size());
  }
  codec::FrameDecoder decoder;
  measure(state, kPulses, bytes, [&] {
    for (const auto& frame : frames) {
      if (decoder.decode(frame) != codec::DecodeStatus::kOk)
        state.SkipWithError("the frame cannot be decoded");
    }
  });
}

BENCHMARK_CAPTURE(encode, live, live_pulses)->Name("encode/10mm");
BENCHMARK_CAPTURE(decode, live, live_pulses)->Name("decode/10mm");
BENCHMARK_CAPTURE(encode, high, high_pulses)->Name("encode/10mm/deformed");
BENCHMARK_CAPTURE(decode, high, high_pulses)->Name("decode/10mm/deformed");

}  // namespace

namespace {

constexpr double kVoxelM = 0.005;

std::vector<recon::DeformCamera> deform_cameras() {
  std::vector<recon::DeformCamera> cameras;
  for (int c = 0; c < kCameras; ++c) cameras.push_back({&rig()[c].model, &frame_set().frames[c]});
  return cameras;
}

void deform(benchmark::State& state, int threads) {
  const std::vector<recon::DeformCamera> cameras = deform_cameras();
  const Mesh hull = marching_cubes(volume(kVoxelM));
  recon::Deformer deformer({.voxel_m = kVoxelM});
  tbb::task_arena arena(threads);
  Mesh mesh;
  measure(state, 1, 0, [&] {
    mesh = hull;
    arena.execute([&] { deformer.run(recon::SurfaceCameras(cameras, mesh, kVoxelM), mesh); });
    benchmark::DoNotOptimize(mesh.vertices.data());
  });
  state.counters["vertices"] = static_cast<double>(hull.vertices.size());
}

/// All stages from 15 raw Bayer frames to one compact frame, without a pipeline.
void high(benchmark::State& state) {
  const int threads = static_cast<int>(state.range(0));
  std::vector<segmentation::Segmenter> segmenters;
  for (const segmentation::BackgroundModel& model : background_models()) {
    segmenters.emplace_back(model, segmentation::SegmentOptions{});
  }
  recon::ReconstructOptions chosen = options(kVoxelM, threads);
  chosen.quality = Quality::kHigh;
  recon::Reconstructor reconstructor(rig(), chosen);
  tbb::task_arena arena(threads);
  measure(state, 1, static_cast<double>(kSize.pixels()) * kCameras, [&] {
    recon::FrameSet set;
    set.frames.resize(kCameras);
    arena.execute([&] {
      tbb::parallel_for(0, kCameras, [&](int c) {
        const ImageView raw = raw_frames()[c].view();
        set.frames[c] = observe(rig()[c].name, {}, raw, segmenters[c].segment(raw));
      });
    });
    benchmark::DoNotOptimize(reconstructor.reconstruct(std::move(set)).compact);
  });
}

BENCHMARK_CAPTURE(deform, one, 1)->Name("deform/5mm")->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(deform, two, 2)->Name("deform/5mm/threads:2")->Unit(benchmark::kMillisecond);
BENCHMARK(high)
    ->Name("high/5mm")
    ->ArgName("threads")
    ->Arg(1)
    ->Arg(2)
    ->Unit(benchmark::kMillisecond);

// Reeb graphs and their similarity. The surface is the visual hull of the simulated performer.

Mesh hull(double voxel_m) { return recon::marching_cubes(volume(voxel_m)); }

void reeb_graph(benchmark::State& state, double voxel_m) {
  const Mesh mesh = hull(voxel_m);
  tbb::task_arena arena(static_cast<int>(state.range(0)));
  measure(state, 1, 0,
          [&] { arena.execute([&] { benchmark::DoNotOptimize(recon::reeb_graph(mesh)); }); });
  state.counters["vertices"] = static_cast<double>(mesh.vertices.size());
}

void graph_similarity(benchmark::State& state) {
  const recon::ReebGraph a = recon::reeb_graph(hull(0.016)), b = recon::reeb_graph(hull(0.02));
  measure(state, 1, 0, [&] { benchmark::DoNotOptimize(recon::graph_similarity(a, b)); });
}

BENCHMARK_CAPTURE(reeb_graph, 16mm, 0.016)
    ->Name("reeb_graph/16mm")
    ->ArgName("threads")
    ->Arg(1)
    ->Arg(2);
BENCHMARK_CAPTURE(reeb_graph, 8mm, 0.008)->Name("reeb_graph/8mm")->ArgName("threads")->Arg(2);
BENCHMARK(graph_similarity)->Name("graph_similarity/16mm");

}  // namespace

}  // namespace v3d::bench
