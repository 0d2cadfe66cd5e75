// The labels of performers in live meshes, with volumes of the test.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>

#include "base/core/error.h"
#include "recon/performers/blocks.h"
#include "recon/performers/performer_labeller.h"
#include "recon/pipeline/compact_frame.h"
#include "recon/pipeline/stages.h"
#include "recon_pipeline_on_bus.h"
#include "support/child_process.h"
#include "take/logs/mesh_file.h"

namespace v3d::recond {
namespace {

using recon::body_at;
using test::becomes_true;
using test::within;
using testing::Contains;

constexpr int64_t kPulses = 14;
/// It has no mesh.
constexpr int64_t kFailing = 5;
constexpr int64_t kWarmUp = -7;

/// Two bodies who walk towards each other until they touch.
class LabellingPipeline : public ReconPipelineOnBus {
 protected:
  static recon::SparseVolume volume_at(int64_t pulse) {
    // A tracker that followed this body would number the others from 2.
    if (pulse == kWarmUp) return recon::volume_of({body_at(1.3)});
    // A tracker that followed this volume would lose the second body and number it 3.
    if (pulse == kFailing) return recon::volume_of({body_at(-0.6)});
    const double half = 0.6 - 0.05 * static_cast<double>(std::min<int64_t>(pulse, 9));
    return recon::volume_of({body_at(-half), body_at(half)});
  }
  ~LabellingPipeline() override { pipeline_.reset(); }

  void begin_labelling() {
    pipeline_.emplace(
        ReconPipeline::Setup{.take = "kendo-07",
                             .mesh_file = folder_ / "mesh.v3d",
                             .stages = {.make_mesh = [this](auto& work) { make_mesh(work); },
                                        .encode = [this](auto& work) { encode_mesh(work); },
                                        .begin_sequence = [this] { encoder_.restart(); }},
                             .threads = 2,
                             .sets = {.cameras = {"cam01"}},
                             .warm_up = recon::FrameSet{.pulse = kWarmUp, .frames = {}},
                             .performers = true},
        bus_);
  }
  void make_mesh(recon::FrameSetJob& work) {
    work.result.pulse = work.set.pulse;
    work.volume = volume_at(work.set.pulse);
    work.result.mesh = recon::marching_cubes(work.volume);
    work.result.mesh.colours.assign(work.result.mesh.vertices.size(), Rgb8{9, 99, 200});
    last_made_ = work.set.pulse;
  }
  /// Waits for the mesh of the next pulse, so that two pulses are in the stages.
  void encode_mesh(recon::FrameSetJob& work) {
    const int64_t pulse = work.set.pulse;
    if (pulse == kWarmUp) return;
    if (pulse < kPulses - 1) becomes_true([&] { return last_made_ > pulse; }, within(30));
    if (pulse == kFailing) throw InputError("the surface is too large");
    recon::PulseMetadata metadata;
    metadata.pulse = pulse;
    metadata.performers = work.result.performers;
    work.result.compact = encoder_.encode(metadata, work.volume, work.result.mesh);
  }
  /// Sends all pulses, and waits until they have meshes.
  void record() {
    for (int64_t pulse = 0; pulse < kPulses; ++pulse) send(pulse);
    ASSERT_TRUE(becomes_true([&] { return pipeline_->counts().meshes == kPulses - 1; }, within(60)))
        << pipeline_->counts().meshes << " meshes, " << pipeline_->counts().failure;
    EXPECT_TRUE(pipeline_->close());
  }

  std::atomic<int64_t> last_made_ = -1;
  recon::EncodeStage encoder_{recon::block_grid(), std::nullopt};
};

TEST_F(LabellingPipeline, labels_meshes_by_ascending_pulse_without_those_that_failed) {
  bus::Subscription<wire::MeshMessage> shown(bus_, wire::kMeshChannel, 100);
  begin_labelling();
  record();
  EXPECT_EQ(pipeline_->counts().performers, 2);
  take::MeshFileReader meshes(folder_ / "mesh.v3d");
  ASSERT_EQ(std::ssize(meshes.pulses()), kPulses - 1);
  recon::PerformerLabeller labeller;
  recon::CompactDecoder decoder;
  for (const int64_t pulse : meshes.pulses()) {
    const auto compact = meshes.read(pulse).value().value();
    ASSERT_EQ(decoder.decode(compact), codec::DecodeStatus::kOk) << pulse;
    const std::vector<uint8_t> labels = decoder.frame().performers;
    EXPECT_EQ(labels, labeller.label(pulse, volume_at(pulse))) << pulse;
    EXPECT_THAT(labels, Contains(1)) << pulse;
    EXPECT_THAT(labels, Contains(2)) << pulse;
    const auto live = shown.wait(within(5));
    ASSERT_TRUE(live);
    EXPECT_EQ(live->pulse, pulse);
    EXPECT_EQ(live->compact, compact) << "viewers get the labels, too";
  }
}

}  // namespace
}  // namespace v3d::recond
