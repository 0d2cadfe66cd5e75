// Scenario tests of the daemons as services: notifications to systemd, and exit after invalid
// input.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <csignal>

#include "support/child_process.h"
#include "support/notify_socket.h"
#include "support/temporary_folder.h"

namespace v3d {
namespace {

using test::becomes_true;
using test::ChildProcess;
using test::within;
using testing::HasSubstr;

constexpr char kStudio[] = R"(name = "dojo"
[[node]]
name = "cap01"
[[node]]
name = "recon01"
[[node]]
name = "desk"
[[camera]]
name = "cam01"
node = "cap01"
address = "127.0.0.99"
[trigger]
node = "cap01"
kind = "simulated"
wire = "trigger.sock"
[space]
min = [-1.5, -1.5, 0]
max = [1.5, 1.5, 2]
[network]
lcm_url = "udpm://239.255.76.67:7667?ttl=0"
[storage]
takes = "takes"
background = "background"
calib = "calib.toml"
[reconstruction]
node = "RECON"
)";

/// Waits up to 30 s until `word` was received `times` times. False at timeout.
bool receives(test::NotifySocket& notified, const std::string& word, int times) {
  return becomes_true([&] { return notified.count(word) >= times; }, within(30));
}

class Service : public testing::Test {
 protected:
  Service() { write_studio("recon01"); }

  void write_studio(const std::string& recon_node) {
    std::string text = kStudio;
    text.replace(text.find("RECON"), 5, recon_node);
    test::write_text(folder_ / "studio.toml", text);
  }
  ChildProcess start(const std::string& program, const std::string& node) {
    return ChildProcess(
        {std::string(V3D_BIN) + "/" + program, "--studio", folder_ / "studio.toml", "--node", node},
        folder_ / "log");
  }
  /// Expects that a daemon exits with status 2 because of its input. Returns its output.
  std::string error_output(const std::string& program, const std::string& node) {
    ChildProcess daemon = start(program, node);
    EXPECT_EQ(daemon.wait(within(30)), 2) << daemon.output();
    return daemon.output();
  }

  const test::TemporaryFolder folder_;
};

TEST_F(Service, notifies_systemd_when_it_is_ready_alive_and_stopping) {
  for (const auto& [program, node] :
       {std::pair{"v3d-captured", "cap01"}, {"v3d-recond", "recon01"}}) {
    test::NotifySocket systemd(folder_ / (std::string(node) + ".notify"));
    ChildProcess daemon = start(program, node);
    EXPECT_TRUE(receives(systemd, "READY=1", 1)) << daemon.output();
    EXPECT_TRUE(receives(systemd, "WATCHDOG=1", 3)) << daemon.output();
    EXPECT_TRUE(receives(systemd, "STATUS=idle", 1)) << daemon.output();
    daemon.signal(SIGTERM);
    EXPECT_EQ(daemon.wait(within(30)), 0) << daemon.output();
    EXPECT_TRUE(receives(systemd, "STOPPING=1", 1)) << daemon.output();
  }
}

TEST_F(Service, reports_what_is_wrong_with_its_input_and_exits_with_2) {
  EXPECT_THAT(error_output("v3d-captured", "desk"),
              HasSubstr("has neither a camera nor the trigger"));
  EXPECT_THAT(error_output("v3d-captured", "nobody"), HasSubstr("'nobody'"));
  EXPECT_THAT(error_output("v3d-recond", "desk"),
              HasSubstr("the reconstruction runs on 'recon01'"));
  write_studio("cap01");
  EXPECT_THAT(error_output("v3d-recond", "cap01"), HasSubstr("a [[node]] of its own"));
  std::filesystem::remove(folder_ / "studio.toml");
  EXPECT_THAT(error_output("v3d-captured", "cap01"), HasSubstr("studio.toml: No such file"));
}

}  // namespace

}  // namespace v3d
