// Scenario test of live silhouette repair: a camera loses a part of every silhouette while a take
// is recorded.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "capture/segmentation/background.h"
#include "codec/frame_codec.h"
#include "comparable_meshes.h"
#include "daemon/bus/bus.h"
#include "studio4.h"
#include "take/logs/mesh_file.h"
#include "take/logs/repaired_pulses.h"
#include "wire/messages.h"

namespace v3d {
namespace {

using test::becomes_true;
using test::ChildProcess;
using test::within;
using testing::IsEmpty;
using testing::Not;

constexpr char kFaulty[] = "cam03";

/// A studio whose plates of cam03 are useless in a band across the performer.
class DefectiveStudio8 : public test::Studio4 {
 protected:
  DefectiveStudio8()
      // A pulse is repaired only while no other waits: at 2 Hz also on a busy machine.
      : Studio4({.cameras = 8, .more = "repair = true\n", .rate = "2"}),
        bus_(studio_.network.lcm_url) {}
  void SetUp() override {
    events_.emplace(bus_, wire::kEventChannel, 1024);
    lose_a_band();
  }

  /// As if this part of the background had flickered when it was learnt: it hides what is before
  /// it.
  void lose_a_band() const {
    const std::filesystem::path& folder = studio_.storage.background;
    segmentation::BackgroundModel model = segmentation::load_background(folder, kFaulty);
    const auto height = static_cast<size_t>(model.size.height);
    const size_t row = model.spread.size() / height;
    const auto at = [&](size_t y) {
      return model.spread.begin() + static_cast<ptrdiff_t>(y * row);
    };
    std::fill(at(height * 45 / 100), at(height * 60 / 100), 200.0F);
    segmentation::save_background(folder, kFaulty, model);
  }
  /// Waits up to 60 s for an event about the silhouette of a camera.
  std::optional<wire::EventMessage> repair_event() {
    std::optional<wire::EventMessage> found;
    becomes_true(
        [&] {
          while (auto event = events_->wait(Monotonic::now())) {
            if (event->text.find("silhouette repaired") != std::string::npos) found = event;
          }
          return found.has_value();
        },
        within(60));
    return found;
  }
  /// The meshes of a copy of the take.
  take::MeshFileReader reconstruct(const std::string& name,
                                   const std::vector<std::string>& options) const {
    const take::TakePaths copy{folder_ / name};
    std::filesystem::copy(take().folder, copy.folder, std::filesystem::copy_options::recursive);
    std::vector<std::string> command = {bin("v3dctl"), "reconstruct", copy.folder, "--passes",
                                        "live"};
    command.insert(command.end(), options.begin(), options.end());
    ChildProcess v3dctl(command, folder_ / (name + ".log"));
    EXPECT_EQ(v3dctl.wait(within(120)), 0) << v3dctl.output();
    return take::MeshFileReader(copy.mesh());
  }

  bus::Bus bus_;
  std::optional<bus::Subscription<wire::EventMessage>> events_;
};

TEST_F(DefectiveStudio8, repairs_live_silhouettes_to_the_bytes_of_v3dctl_and_names_the_camera) {
  arm_and_start(0);
  ASSERT_TRUE(reaches("recon01", std::string(kFaulty) + ".repaired_pulses", 3)) << log();
  // Meshes of several key frames: those after a late frame cannot be compared.
  ASSERT_TRUE(reaches("recon01", "repair_repaired", 15)) << log();
  ASSERT_TRUE(reaches("recon01", "meshes", 40)) << log();
  const auto event = repair_event();
  ASSERT_TRUE(event) << log();
  EXPECT_EQ(event->subject, kFaulty);
  EXPECT_EQ(event->severity, wire::Severity::kWarning);
  EXPECT_THAT(event->text, testing::ContainsRegex("missing piece of [0-9,]+ pixels, in the region "
                                                  "[0-9]+ x [0-9]+ at x [0-9]+, y [0-9]+"));
  EXPECT_GE(value("recon01", "repair_checked"), 3);
  EXPECT_GE(value("recon01", "repair_repaired"), 3);
  const control::Answer stopped = command(wire::CommandVerb::kStop);
  ASSERT_TRUE(stopped.done()) << text_of(stopped) << log();

  const auto recon = nlohmann::json::parse(stopped.replies.at("recon01").detail);
  const std::vector<int64_t> repaired = take::read_repaired_pulses(take());
  EXPECT_EQ(std::ssize(repaired), recon["repair_repaired"].get<int64_t>()) << recon;
  EXPECT_GE(recon["cam03.repaired_pixels"], 100) << recon;
  EXPECT_EQ(recon["repair_checked"].get<int64_t>() + recon["repair_unchecked"].get<int64_t>(),
            recon["meshes"].get<int64_t>())
      << recon;

  take::MeshFileReader live(take().mesh());
  take::MeshFileReader same = reconstruct("repaired", {"--repair-pulses", "live"});
  take::MeshFileReader without = reconstruct("without", {});
  const std::vector<int64_t> pulses = test::comparable_meshes(live);
  ASSERT_THAT(pulses, Not(IsEmpty())) << log();
  for (const int64_t pulse : pulses) {
    EXPECT_EQ(live.read(pulse).value(), same.read(pulse).value()) << "pulse " << pulse;
  }
  EXPECT_TRUE(std::ranges::any_of(pulses, [&](int64_t pulse) {
    return std::ranges::binary_search(repaired, pulse) &&
           live.read(pulse).value() != without.read(pulse).value();
  })) << "a repair changes the mesh";
}

}  // namespace
}  // namespace v3d
