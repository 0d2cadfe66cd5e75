// Scenario test of v3d-viewd whose disk does not answer: live meshes, the state of the studio and
// orders need no disk.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "viewed_studio.h"

namespace v3d {
namespace {

using test::becomes_true;
using test::Connection;
using test::within;
using testing::HasSubstr;
using testing::Not;

/// v3d-viewd with v3d_hanging_disk (support/hanging_disk.cc).
class HangingDiskViewer : public test::ViewedStudio {
 protected:
  HangingDiskViewer() : ViewedStudio(test::kAcceptsOrders) {
    viewd_.reset();
    std::filesystem::remove(folder_ / "v3d-viewd.log");
    viewd_.emplace(std::vector<std::string>{"/usr/bin/env",
                                            std::string("LD_PRELOAD=") + V3D_HANGING_DISK_LIBRARY,
                                            "V3D_HANGING_DISK=" + control().string(),
                                            "V3D_HANGING_FOLDER=" + folder_.path().string(),
                                            bin("v3d-viewd"), "--studio", folder_ / "studio.toml"},
                   folder_ / "v3d-viewd.log");
    port_ = test::served_port(*viewd_);
  }
  ~HangingDiskViewer() override { release(); }

  std::filesystem::path control() const { return outside_ / "hangs"; }
  void hang() const { test::write_text(control(), ""); }
  void release() const { std::filesystem::remove(control()); }

  /// Records a take and adds a scene with a large file.
  void record_take() {
    arm_and_start(20);
    ASSERT_TRUE(becomes_idle()) << log();
    ASSERT_TRUE(command(wire::CommandVerb::kStop).done()) << log();
    test::write_text(take().folder / "scene.json", "{}");
    test::write_text(take().folder / "film.mp4", "film");
    std::filesystem::resize_file(take().folder / "film.mp4", kFilmBytes);
  }

  bool viewd_has_open(const std::string& name) const {
    const std::string descriptors = "/proc/" + std::to_string(viewd_->pid()) + "/fd";
    std::error_code error;
    for (const auto& entry : std::filesystem::directory_iterator(descriptors, error)) {
      if (std::filesystem::read_symlink(entry, error).filename() == name) return true;
    }
    return false;
  }

  static constexpr uint64_t kFilmBytes = 64 << 20;
  const test::TemporaryFolder outside_;
};

TEST_F(HangingDiskViewer, serves_live_meshes_state_and_orders_while_the_disk_does_not_answer) {
  ASSERT_NO_FATAL_FAILURE(record_take());
  // A client that does not read yet: the film is sent until the buffers of the sockets are full.
  const auto film = get("/takes/kendo-07/film.mp4");
  ASSERT_TRUE(becomes_true([&] { return viewd_has_open("film.mp4"); }, within(30)));
  hang();
  std::vector<std::unique_ptr<Connection>> waiting;
  for (const char* const target :
       {"/", "/api/takes", "/api/scenes", "/api/rig", "/api/takes/kendo-07/rig",
        "/api/takes/kendo-07/photographs/3/cam01.jpg", "/api/takes/kendo-07/views/3",
        "/takes/kendo-07/mesh.v3d", "/takes/kendo-07/scene.json"}) {
    waiting.push_back(get(target));
  }
  ASSERT_TRUE(film->receives("200 OK")) << "makes room for the next parts" << viewd_->output();
  const auto live = watch("/api/live"), studio = watch("/api/studio");
  take_name_ = "kendo-08";
  arm_and_start(0);
  EXPECT_TRUE(live->receives("\"pulse\":1")) << viewd_->output();
  EXPECT_TRUE(studio->receives("\"state\":\"recording\"")) << viewd_->output();
  EXPECT_TRUE(get("/api/order")->receives("200 OK"));
  const auto order = post(R"({"do": "stop"})", test::kOperatorToken);
  EXPECT_TRUE(order->receives("202 Accepted")) << order->text();
  const auto is_done = [&] {
    const auto status = get("/api/order");
    return status->receives("\"under_way\"") &&
           status->text().find("\"under_way\":false") != std::string::npos;
  };
  EXPECT_TRUE(becomes_true(is_done, within(60))) << viewd_->output();
  for (const auto& one : waiting) EXPECT_THAT(one->text(), Not(HasSubstr("200 OK")));
  EXPECT_LT(film->text().size(), kFilmBytes);

  release();
  const auto lists_new_take = [&] {
    const auto takes = get("/api/takes");
    return takes->receives("]}") && takes->text().find("kendo-08") != std::string::npos;
  };
  EXPECT_TRUE(becomes_true(lists_new_take, within(60))) << viewd_->output();
  EXPECT_TRUE(get("/takes/kendo-07/mesh.v3d")->receives("V3DM")) << viewd_->output();
}

TEST_F(HangingDiskViewer, answers_503_when_its_disk_is_late) {
  ASSERT_NO_FATAL_FAILURE(record_take());
  hang();
  std::vector<std::unique_ptr<Connection>> waiting;
  for (const char* const target : {"/", "/api/takes", "/api/rig", "/takes/kendo-07/mesh.v3d"}) {
    waiting.push_back(get(target));
  }
  for (const auto& one : waiting) {
    EXPECT_TRUE(one->receives("503 Service")) << one->text() << viewd_->output();
  }
  release();
  EXPECT_TRUE(
      becomes_true([&] { return get("/takes/kendo-07/mesh.v3d")->receives("V3DM"); }, within(60)));
}

}  // namespace
}  // namespace v3d
