// Scenario tests of the HTTP and WebSocket replies of the real v3d-viewd while a studio records.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <memory>

#include "take/ledger/verify.h"
#include "take/logs/mesh_file.h"
#include "viewed_studio.h"

namespace v3d {
namespace {

using test::becomes_true;
using test::Connection;
using test::served_port;
using test::ViewedStudio;
using test::within;
using test::write_text;
using testing::HasSubstr;
using testing::Not;

constexpr int kPulses = 40;

TEST_F(ViewedStudio, serves_state_previews_meshes_and_takes_to_browsers) {
  const auto studio = watch("/api/studio");
  const auto live = watch("/api/live");
  EXPECT_TRUE(studio->receives("\"state\":\"idle\"")) << studio->text() << viewd_->output();
  arm_and_start(0);
  EXPECT_TRUE(studio->receives("\"state\":\"recording\"")) << viewd_->output();
  EXPECT_TRUE(studio->receives("\"type\":\"preview\"")) << viewd_->output();
  ASSERT_TRUE(reaches("cap01", "frames_written", 4 * kPulses)) << log();
  ASSERT_TRUE(command(wire::CommandVerb::kStop).done()) << log();
  const std::string end = std::to_string(verify_take(take()).ledger.commanded);
  // A busy machine does not make a mesh of every pulse.
  const auto meshes = take::MeshFileReader(take().mesh()).pulses();
  ASSERT_FALSE(meshes.empty()) << log();
  // A busy v3d-viewd does not pass on every mesh.
  const auto shows_a_mesh = [&] {
    return std::ranges::any_of(meshes, [&](int64_t pulse) {
      return live->text().find("\"pulse\":" + std::to_string(pulse) + ",") != std::string::npos;
    });
  };
  EXPECT_TRUE(becomes_true(shows_a_mesh, within(30))) << viewd_->output();
  const std::string count = "\"meshes\":" + std::to_string(meshes.size());
  EXPECT_TRUE(get("/api/takes")->receives(count)) << get("/api/takes")->text();
  EXPECT_TRUE(get("/api/takes")->receives("\"state\":\"complete\""));
  EXPECT_TRUE(get("/api/takes/kendo-07/rig")->receives("\"name\":\"cam04\""));
  EXPECT_TRUE(get("/takes/kendo-07/mesh.v3d")->receives("V3DM"));
  EXPECT_TRUE(get("/takes/kendo-07/cam01.lcmlog")->receives("404 Not Found"));
  EXPECT_TRUE(get("/api/takes/kendo-07/photographs/39/cam04.jpg")->receives("JFIF"));
  EXPECT_TRUE(
      get("/api/takes/kendo-07/photographs/" + end + "/cam04.jpg")->receives("404 Not Found"));
}

/// At 4 Hz: a daemon that has just started knows no latency of its cameras. It is certain of the
/// first pulse if one of its first frames arrives within a period.
class RestartedViewedStudio : public ViewedStudio {
 protected:
  RestartedViewedStudio() : ViewedStudio("", {.rate = "4"}) {}
};

/// For each file that the daemons read: a take that a crash left open, and whose file is a FIFO.
TEST_F(RestartedViewedStudio, starts_again_and_records_beside_open_takes_whose_files_are_fifos) {
  arm_and_start(5);
  ASSERT_TRUE(becomes_idle()) << log();
  ASSERT_TRUE(command(wire::CommandVerb::kStop).done()) << log();
  for (const char* file : {"take.toml", "calib.toml", "studio.toml", "slate.toml", "verified.toml",
                           "ledger.toml", "mesh.v3d", "pulses.lcmlog", "cam01.lcmlog"}) {
    const std::filesystem::path trap = folder_ / ("trap-" + std::string(file));
    std::filesystem::copy(take().folder, trap, std::filesystem::copy_options::recursive);
    std::string info = read_file(trap / "take.toml");
    replace(info, "'complete'", "'recording'");
    write_text(trap / "take.toml", info);
    std::filesystem::remove(trap / file);
    ASSERT_EQ(mkfifo((trap / file).c_str(), 0666), 0);
  }
  captured_.reset();
  recond_.reset();
  start_captured();
  start_recond();
  client_.emplace(studio_);
  take_name_ = "kendo-08";
  ASSERT_TRUE(becomes_true([&] { return command(wire::CommandVerb::kArm, 10).done(); }, within(60)))
      << log();
  ASSERT_TRUE(command(wire::CommandVerb::kStart).done()) << log();
  ASSERT_TRUE(becomes_idle()) << log();
  ASSERT_TRUE(command(wire::CommandVerb::kStop).done()) << log();
  EXPECT_TRUE(verify_take(take()).whole()) << verify_take(take()).ledger.verdict() << log();
  EXPECT_TRUE(get("/api/takes")->receives("kendo-08"));
}

TEST_F(ViewedStudio, survives_invalid_requests_and_clients_that_leave_without_reading) {
  std::vector<std::unique_ptr<Connection>> clients;
  for (int i = 0; i < 40; ++i) {
    clients.push_back(watch("/api/live"));
    clients.push_back(std::make_unique<Connection>(port_, "/", std::string(20'000, 'x')));
    clients.push_back(std::make_unique<Connection>(port_, "\r\n\r\n\x16\x03\x01", "\r\n"));
  }
  clients.clear();
  EXPECT_TRUE(get("/")->receives("<!doctype html>")) << viewd_->output();
  EXPECT_TRUE(viewd_->runs());
  viewd_->signal(SIGTERM);
  EXPECT_EQ(viewd_->wait(within(30)), 0) << viewd_->output();
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

/// v3d-viewd with a limit of 40 descriptors, which the test exhausts.
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
  int count_in_log(const std::string& part) const {
    const std::string output = viewd_->output();
    int count = 0;
    for (size_t at = output.find(part); at != std::string::npos; at = output.find(part, at + 1)) {
      ++count;
    }
    return count;
  }

  const test::TemporaryFolder folder_;
  std::optional<test::ChildProcess> viewd_;
  int port_ = 0;
};

TEST_F(ViewerWithFewDescriptors, limits_the_rate_of_accept_attempts_without_free_descriptors) {
  const MonotonicInstant begin = Monotonic::now();
  std::vector<std::unique_ptr<Connection>> clients;
  for (int i = 0; i < 2 * kDescriptors; ++i) {
    clients.push_back(std::make_unique<Connection>(port_, "/", ""));
  }
  const std::string not_accepted = "a connection was not accepted";
  ASSERT_TRUE(becomes_true([&] { return count_in_log(not_accepted) > 5; }, within(30)));
  // The daemon tries ten times a second. Without a pause it would try thousands of times.
  const auto attempts = count_in_log(not_accepted);
  const double seconds = to_seconds(Monotonic::now() - begin);
  EXPECT_LE(attempts, 12 * (seconds + 1)) << seconds << " s";
  EXPECT_GE(count_in_log("cannot accept a connection"), 1) << viewd_->output();
  const auto gets_a_reply = [](const auto& client) {
    return client->text().find("HTTP/1.1 ") != std::string::npos;
  };
  EXPECT_TRUE(becomes_true([&] { return std::ranges::any_of(clients, gets_a_reply); }, within(30)));
  for (const auto& client : clients) EXPECT_THAT(client->text(), Not(HasSubstr("404")));
  clients.clear();
  // 503 is right until the daemon has closed the connections of these clients.
  const auto is_served = [&] {
    Connection client(port_, "/", "Connection: close\r\n");
    return client.receives("\r\n\r\n") && client.text().find(" 200 OK") != std::string::npos;
  };
  EXPECT_TRUE(becomes_true(is_served, within(30))) << viewd_->output();
}

}  // namespace
}  // namespace v3d
