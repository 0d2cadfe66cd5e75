// Test fixture: a ReconPipeline on real multicast, with the stages of the test.
#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <optional>
#include <semaphore>
#include <string>
#include <utility>
#include <vector>

#include "daemon/bus/bus.h"
#include "daemon/recond/recon_pipeline.h"
#include "support/temporary_folder.h"
#include "wire/messages.h"

namespace v3d::recond {

/// A pipeline of one camera, fed over the bus, whose stages are the test's.
class ReconPipelineOnBus : public testing::Test {
 protected:
  static constexpr ImageSize kSize{16, 8};
  static constexpr char kUrl[] = "udpm://239.255.76.67:7667?ttl=0";

  void begin(MeshStages stages, std::optional<recon::FrameSet> warm_up = std::nullopt) {
    pipeline_.emplace(ReconPipeline::Setup{.take = "kendo-07",
                                           .mesh_file = folder_ / "mesh.v3d",
                                           .stages = std::move(stages),
                                           .threads = 2,
                                           .sets = {.cameras = {"cam01"}},
                                           .warm_up = std::move(warm_up)},
                      bus_);
  }
  void send(int64_t pulse) {
    wire::FrameMessage message;
    message.take = "kendo-07";
    FrameLabel label;
    label.pulse = pulse;
    const Image raw(kSize, PixelFormat::kBayerRG8);
    message.frame = observe("cam01", label, raw.view(), Mask(kSize));
    message.seq = numbers_.next(pulse);
    bus_.publish_frame(pulse, wire::frame_channel("cam01"), encode(message));
  }
  static void name_pulse(recon::FrameSetJob& work) { work.result.pulse = work.set.pulse; }
  static void write_pulse(recon::FrameSetJob& work) {
    work.result.compact.assign(3, static_cast<uint8_t>(work.result.pulse));
  }

  /// Every pulse waits for `go` in the first stage.
  void begin_held(std::counting_semaphore<>& go) {
    begin({.make_mesh =
               [&go](recon::FrameSetJob& work) {
                 go.acquire();
                 name_pulse(work);
               },
           .encode = write_pulse});
  }

  explicit ReconPipelineOnBus(const std::vector<std::string>& frame_groups = {})
      : bus_(kUrl, frame_groups), numbers_(bus_.frame_groups()) {}

  const test::TemporaryFolder folder_;
  bus::Bus bus_;
  bus::FrameNumbers numbers_;
  std::optional<ReconPipeline> pipeline_;
};

}  // namespace v3d::recond
