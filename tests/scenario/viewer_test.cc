// What a browser gets of a studio that records, from the real v3d-viewd.
#include <gtest/gtest.h>

#include <fstream>
#include <memory>

#include "viewed_studio.h"

namespace v3d {
namespace {

using test::becomes_true;
using test::Connection;
using test::served_port;
using test::ViewedStudio;
using test::within;

constexpr int kPulses = 40;

TEST_F(ViewedStudio, serves_state_previews_meshes_and_takes_to_browsers) {
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
  EXPECT_TRUE(get("/api/takes/kendo-07/photographs/39/cam04.jpg")->hears("JFIF"));
  EXPECT_TRUE(get("/api/takes/kendo-07/photographs/40/cam04.jpg")->hears("404 Not Found"));
}

TEST_F(ViewedStudio, survives_invalid_requests_and_clients_that_never_read) {
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

constexpr const char* kSmallStudio = R"(
name = "dojo"
[[node]]
name = "cap01"
[[node]]
name = "recon01"
[[camera]]
name = "cam01"
node = "cap01"
address = "127.0.0.11"
[trigger]
node = "cap01"
wire = "trigger.sock"
[space]
min = [-1.5, -1.5, 0.0]
max = [1.5, 1.5, 2.5]
[network]
lcm_url = "udpm://239.255.76.67:7667?ttl=0"
[storage]
takes = "takes"
background = "background"
calib = "calib.toml"
[reconstruction]
node = "recon01"
[viewer]
listen = "127.0.0.1:0"
page = "page"
)";

/// v3d-viewd with so few descriptors that they run out.
class ViewerWithFewDescriptors : public testing::Test {
 protected:
  static constexpr int kDescriptors = 40;

  ViewerWithFewDescriptors() {
    std::filesystem::create_directories(folder_ / "page");
    std::ofstream(folder_ / "page/index.html") << "<!doctype html>";
    std::ofstream(folder_ / "studio.toml") << kSmallStudio;
    const std::string program = std::string(V3D_BIN) + "/v3d-viewd";
    viewd_.emplace(
        std::vector<std::string>{"/bin/sh", "-c",
                                 "ulimit -n " + std::to_string(kDescriptors) + "; exec " + program +
                                     " --log-level debug --studio " +
                                     (folder_ / "studio.toml").string()},
        folder_ / "v3d-viewd.log");
    port_ = served_port(*viewd_);
  }
  int times_said(const std::string& what) const {
    const std::string said = viewd_->output();
    int count = 0;
    for (size_t at = said.find(what); at != std::string::npos; at = said.find(what, at + 1)) {
      ++count;
    }
    return count;
  }

  const test::TemporaryFolder folder_;
  std::optional<test::ChildProcess> viewd_;
  int port_ = 0;
};

TEST_F(ViewerWithFewDescriptors, limits_the_rate_of_accept_attempts_without_free_descriptors) {
  std::vector<std::unique_ptr<Connection>> visitors;
  for (int i = 0; i < 2 * kDescriptors; ++i) {
    visitors.push_back(std::make_unique<Connection>(port_, "/", ""));
  }
  const std::string not_accepted = "a connection was not accepted";
  ASSERT_TRUE(becomes_true([&] { return times_said(not_accepted) > 0; }, within(30)));
  const MonotonicInstant begin = Monotonic::now();
  ASSERT_TRUE(becomes_true([&] { return times_said(not_accepted) > 5; }, within(30)));
  // Ten times a second: were it not to wait, it would be thousands.
  const double seconds = to_seconds(Monotonic::now() - begin);
  EXPECT_LE(times_said(not_accepted), 12 * (seconds + 1)) << seconds << " s";
  EXPECT_GE(times_said("cannot accept a connection"), 1) << viewd_->output();
  visitors.clear();
  EXPECT_TRUE(Connection(port_, "/", "Connection: close\r\n").hears("<!doctype html>"))
      << viewd_->output();
}

}  // namespace
}  // namespace v3d
