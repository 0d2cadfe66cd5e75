// Scenario tests of takes that two nodes sign: verification detects any change in the archive.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <csignal>

#include "studio4.h"

namespace v3d {
namespace {

using test::ChildProcess;
using test::Studio4;
using test::within;
using testing::AllOf;
using testing::HasSubstr;

class SignedStudio : public Studio4 {
 protected:
  SignedStudio() : Studio4({.is_signed = true, .two_nodes = true}) {}

  void record_and_collect() {
    ASSERT_NO_FATAL_FAILURE(arm_and_start(10));
    ASSERT_TRUE(reaches("cap01", "frames_written", 20)) << log();
    const Answer stopped = command(CommandVerb::kStop);
    ASSERT_TRUE(stopped.done()) << text_of(stopped) << log();
    const auto [status, text] = v3dctl({"takes", "collect", take_name_, "--to", archive().string(),
                                        "--from", "cap01=" + folder_.path().string(), "--from",
                                        "cap02=" + (folder_ / "cap02").string()});
    ASSERT_EQ(status, 0) << text;
  }
  std::pair<int, std::string> v3dctl(const std::vector<std::string>& words) const {
    std::vector<std::string> command = {bin("v3dctl"), "--studio", folder_ / "studio.toml"};
    command.insert(command.end(), words.begin(), words.end());
    ChildProcess process(command, folder_ / "v3dctl.log");
    const int status = process.wait(within(60)).value_or(-1);
    return {status, process.output()};
  }
  std::pair<int, std::string> verify() const {
    return v3dctl({"verify", (archive() / take_name_).string(), "--signed"});
  }
  std::filesystem::path archive() const { return folder_ / "archive"; }
};

TEST_F(SignedStudio, verifies_the_signatures_of_a_collected_take_and_detects_a_changed_byte) {
  ASSERT_NO_FATAL_FAILURE(record_and_collect());
  const auto [status, text] = verify();
  EXPECT_EQ(status, 0) << text;
  for (const StudioNode& node : studio_.nodes) {
    if (node.name == "recon01") continue;
    EXPECT_THAT(text, HasSubstr("signed by " + node.name + ", key " + node.public_key + ": "));
  }

  const std::filesystem::path log = archive() / take_name_ / "cam03.lcmlog";
  std::string frames = read_file(log);
  frames[frames.size() / 2] = static_cast<char>(frames[frames.size() / 2] ^ 1);
  std::filesystem::remove(log);  // it is a hard link to the node's file
  test::write_text(log, frames);
  EXPECT_EQ(verify().first, 3);
  EXPECT_THAT(verify().second, HasSubstr("cam03.lcmlog: does not match the signature of cap02"));
}

TEST_F(SignedStudio, does_not_start_a_node_with_a_key_other_than_that_of_the_studio_file) {
  captured_->signal(SIGTERM);
  captured_->wait(within(30));
  std::filesystem::remove(folder_ / "node.key");
  SigningKey::make().save(folder_ / "node.key");
  start_captured();
  EXPECT_EQ(captured_->wait(within(30)), 2);
  EXPECT_THAT(captured_->output(), AllOf(HasSubstr("node.key: its public key is "),
                                         HasSubstr("has another for node cap01")));
}

}  // namespace
}  // namespace v3d
