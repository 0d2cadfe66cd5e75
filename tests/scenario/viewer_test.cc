// What a browser gets of a studio that records, from the real v3d-viewd.
#include <gtest/gtest.h>

#include "viewed_studio.h"

namespace v3d {
namespace {

using test::becomes_true;
using test::Connection;
using test::ViewedStudio;
using test::within;

constexpr int kPulses = 40;

TEST_F(ViewedStudio, shows_browsers_its_state_its_pictures_its_meshes_and_its_take) {
  const auto studio = watch("/api/studio");
  const auto live = watch("/api/live");
  EXPECT_TRUE(studio->hears("\"state\":\"idle\"")) << studio->text() << viewd_->output();
  arm_and_start(kPulses);
  EXPECT_TRUE(studio->hears("\"state\":\"recording\"")) << viewd_->output();
  EXPECT_TRUE(studio->hears("\"type\":\"preview\"")) << viewd_->output();
  EXPECT_TRUE(live->hears("\"pulse\":39")) << viewd_->output();
  ASSERT_TRUE(becomes_idle()) << log();
  ASSERT_TRUE(command(CommandVerb::kStop).done()) << log();
  EXPECT_TRUE(get("/api/takes")->hears("\"meshes\":40")) << get("/api/takes")->text();
  EXPECT_TRUE(get("/api/takes")->hears("\"state\":\"complete\""));
  EXPECT_TRUE(get("/api/takes/kendo-07/rig")->hears("\"name\":\"cam04\""));
  EXPECT_TRUE(get("/takes/kendo-07/mesh.v3d")->hears("V3DM"));
  EXPECT_TRUE(get("/takes/kendo-07/cam01.lcmlog")->hears("404 Not Found"));
}

TEST_F(ViewedStudio, outlives_whoever_sends_it_rubbish_or_never_reads) {
  std::vector<std::unique_ptr<Connection>> strangers;
  for (int i = 0; i < 40; ++i) {
    strangers.push_back(watch("/api/live"));
    strangers.push_back(std::make_unique<Connection>(port_, "/", std::string(20'000, 'x')));
    strangers.push_back(std::make_unique<Connection>(port_, "\r\n\r\n\x16\x03\x01", "\r\n"));
  }
  strangers.clear();
  EXPECT_TRUE(get("/")->hears("<!doctype html>")) << viewd_->output();
  EXPECT_TRUE(viewd_->runs());
  viewd_->signal(SIGTERM);
  EXPECT_EQ(viewd_->wait(within(10)), 0) << viewd_->output();
}

}  // namespace
}  // namespace v3d
