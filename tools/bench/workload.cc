#include "workload.h"

#include <optional>
#include <utility>

#include "sim/rendering/camera_images.h"
#include "sim/rendering/scene.h"

namespace v3d::bench {
namespace {

struct Pictures {
  std::vector<std::vector<Image>>
      plates;  ///< images of the empty studio, one vector for each camera
  std::vector<Image> frames;
};

const Pictures& pictures() {
  static const Pictures kPictures = [] {
    sim::BatchRenderer film(rig(), {.seed = kSeed});
    Pictures taken;
    taken.plates.resize(kCameras);
    for (int i = 0; i < kPlates; ++i) {
      std::vector<Image> shot = film.render_all(std::nullopt, i);
      for (int c = 0; c < kCameras; ++c) {
        taken.plates[c].push_back(std::move(shot[c]));
      }
    }
    taken.frames = film.render_all(kInstantSeconds, kPlates);
    return taken;
  }();
  return kPictures;
}

segmentation::BackgroundModel learn(int camera) {
  std::vector<ImageView> views;
  for (const Image& plate : plates(camera)) {
    views.push_back(plate.view());
  }
  return segmentation::learn_background(views);
}

}  // namespace

std::vector<segmentation::Segmenter> learnt_segmenters(sim::BatchRenderer& studio) {
  std::vector<std::vector<Image>> shots;
  for (int i = 0; i < kPlates; ++i) {
    shots.push_back(studio.render_all(std::nullopt, static_cast<uint64_t>(i)));
  }
  std::vector<segmentation::Segmenter> segmenters;
  for (size_t c = 0; c < shots.front().size(); ++c) {
    std::vector<ImageView> views;
    for (const auto& shot : shots) views.push_back(shot[c].view());
    segmenters.emplace_back(segmentation::learn_background(views), segmentation::SegmentOptions{});
  }
  return segmenters;
}

namespace {

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

const std::vector<Image>& raw_frames() { return pictures().frames; }

const std::vector<Image>& plates(int camera) { return pictures().plates[camera]; }

const std::vector<segmentation::BackgroundModel>& background_models() {
  static const auto kModels = for_each_camera(learn);
  return kModels;
}

const std::vector<Mask>& masks() {
  static const auto kMasks = for_each_camera([](int c) {
    return segmentation::Segmenter(background_models()[c], {}).segment(raw_frames()[c].view());
  });
  return kMasks;
}

std::vector<const Mask*> pointers_to(const std::vector<Mask>& masks) {
  std::vector<const Mask*> pointers;
  for (const Mask& mask : masks) {
    pointers.push_back(&mask);
  }
  return pointers;
}

recon::Intersector intersector(double voxel_m) {
  return {recon::VoxelGrid::covering(space(), voxel_m), models_of(rig()), kMinViews};
}

recon::SparseVolume volume(double voxel_m) {
  return intersector(voxel_m).intersect(pointers_to(masks()));
}

const recon::FrameSet& frame_set() {
  static const recon::FrameSet kSet = [] {
    recon::FrameSet set;
    for (int c = 0; c < kCameras; ++c) {
      set.frames.push_back(observe(rig()[c].name, {}, raw_frames()[c].view(), masks()[c]));
    }
    return set;
  }();
  return kSet;
}

const std::vector<uint8_t>& compact_10mm() {
  static const std::vector<uint8_t> kCompact =
      recon::Reconstructor(rig(), options(0.01, 0)).reconstruct(frame_set()).compact;
  return kCompact;
}

const recon::CompactFrame& compact_frame_10mm() {
  static const recon::CompactFrame kFrame = recon::decode_compact(compact_10mm()).value();
  return kFrame;
}

recon::ReconstructOptions options(double voxel_m, int threads) {
  recon::ReconstructOptions o;
  o.bounds = space();
  o.voxel_m = voxel_m;
  o.threads = threads;
  return o;
}

}  // namespace v3d::bench
