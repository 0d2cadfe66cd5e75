#include "workload.h"

#include "sim/scene.h"

namespace v3d::bench {
namespace {

constexpr int kPlates = 8;
constexpr double kInstantSeconds = 1.5;

BackgroundModel learn(const RigCamera& camera) {
  std::vector<Image> plates;
  std::vector<ImageView> views;
  for (int i = 0; i < kPlates; ++i) {
    plates.push_back(sim::render(camera, 0, false, i, {.seed = kSeed}));
  }
  for (const Image& plate : plates) {
    views.push_back(plate.view());
  }
  return learn_background(views);
}

template <class Make>
auto for_each_camera(Make make) {
  std::vector<decltype(make(0))> all;
  for (int c = 0; c < kCameras; ++c) {
    all.push_back(make(c));
  }
  return all;
}

}  // namespace

Box space() { return {{-1.5, -1.5, 0}, {1.5, 1.5, 2}}; }

const Rig& rig() {
  static const Rig kRig = sim::make_rig(kCameras, kSize, kSeed);
  return kRig;
}

const std::vector<Image>& raw_frames() {
  static const auto kFrames = for_each_camera(
      [](int c) { return sim::render(rig()[c], kInstantSeconds, true, kPlates, {.seed = kSeed}); });
  return kFrames;
}

const std::vector<BackgroundModel>& background_models() {
  static const auto kModels = for_each_camera([](int c) { return learn(rig()[c]); });
  return kModels;
}

const std::vector<Mask>& masks() {
  static const auto kMasks = for_each_camera(
      [](int c) { return Segmenter(background_models()[c], {}).segment(raw_frames()[c].view()); });
  return kMasks;
}

const FrameSet& frame_set() {
  static const FrameSet kSet = [] {
    FrameSet set;
    for (int c = 0; c < kCameras; ++c) {
      set.frames.push_back(observe(rig()[c].name, {}, raw_frames()[c].view(), masks()[c]));
    }
    return set;
  }();
  return kSet;
}

ReconstructOptions options(double voxel_m, int threads) {
  ReconstructOptions o;
  o.bounds = space();
  o.voxel_m = voxel_m;
  o.threads = threads;
  return o;
}

}  // namespace v3d::bench
