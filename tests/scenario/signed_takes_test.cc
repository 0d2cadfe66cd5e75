// Scenario tests of takes that two nodes sign: verification detects any change in the archive.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <csignal>

#include "studio4.h"
#include "take/ledger/take_signature.h"

namespace v3d {
namespace {

using test::becomes_true;
using test::ChildProcess;
using test::Studio4;
using test::within;
using testing::AllOf;
using testing::ContainsRegex;
using testing::HasSubstr;
using testing::Not;

/// At 5 Hz, a busy machine records whole takes.
class SignedStudio : public Studio4 {
 protected:
  SignedStudio() : Studio4({.rate = "5", .is_signed = true, .two_nodes = true}) {}

  void record_and_collect() {
    ASSERT_NO_FATAL_FAILURE(arm_and_start(10));
    ASSERT_TRUE(reaches("cap01", "frames_written", 20)) << log();
    const control::Answer stopped = command(wire::CommandVerb::kStop);
    ASSERT_TRUE(stopped.done()) << text_of(stopped) << log();
    const auto [status, text] = collect();
    ASSERT_EQ(status, 0) << text;
  }
  std::pair<int, std::string> collect() const {
    return v3dctl({"takes", "collect", take_name_, "--to", archive().string(), "--from",
                   "cap01=" + folder_.path().string(), "--from",
                   "cap02=" + (folder_ / "cap02").string()});
  }
  bool captured_logs(const std::string& text) const {
    return becomes_true([&] { return captured_->output().find(text) != std::string::npos; },
                        within(60));
  }
  std::pair<int, std::string> v3dctl(const std::vector<std::string>& words) const {
    std::vector<std::string> command = {bin("v3dctl"), "--studio", folder_ / "studio.toml"};
    command.insert(command.end(), words.begin(), words.end());
    ChildProcess process(command, folder_ / "v3dctl.log");
    const int status = process.wait(within(60)).value_or(-1);
    return {status, process.output()};
  }
  /// The public key with which cap01 signed the take.
  std::string key_of_signature() const {
    const auto path = signature_path(take(), "cap01");
    return take::parse_signature(read_file(path), path).key.text();
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

TEST_F(SignedStudio, signs_a_running_take_with_the_old_key_and_the_next_one_with_the_new_key) {
  ASSERT_NO_FATAL_FAILURE(arm_and_start(0));
  ASSERT_TRUE(reaches("cap01", "frames_written", 20)) << log();
  const wire::SigningKey next = wire::SigningKey::make();
  next.save(folder_ / "next.key");
  std::filesystem::rename(folder_ / "next.key", folder_ / "node.key");
  ASSERT_TRUE(captured_logs("node.key: a new signing key")) << log();
  EXPECT_TRUE(captured_logs("studio.toml has another for node cap01")) << log();
  const control::Answer stopped = command(wire::CommandVerb::kStop);
  ASSERT_TRUE(stopped.done()) << text_of(stopped) << log();
  const std::string first = studio_.nodes.front().public_key;
  EXPECT_EQ(key_of_signature(), first);

  std::string text = read_file(studio_.path);
  replace(text, first, next.public_key().text());
  test::write_text(studio_.path, text);
  EXPECT_TRUE(captured_logs("signing key: the problem has ended")) << log();
  take_name_ = "kendo-08";
  ASSERT_NO_FATAL_FAILURE(record_and_collect());
  EXPECT_EQ(key_of_signature(), next.public_key().text());
  const auto [status, verified] = verify();
  EXPECT_EQ(status, 0) << verified;
}

TEST_F(SignedStudio, signs_a_recovered_take_in_the_background_and_verify_states_it) {
  ASSERT_NO_FATAL_FAILURE(arm_and_start(0));
  ASSERT_TRUE(reaches("cap01", "frames_written", 20)) << log();
  captured_->signal(SIGKILL);
  ASSERT_TRUE(captured_->wait(within(60)));
  const auto is_closed_by_cap02 = [&] {
    return std::filesystem::exists(folder_ / "cap02" / take_name_ / "signature.cap02.toml");
  };
  start_captured();
  ASSERT_TRUE(becomes_true(is_closed_by_cap02, within(60))) << log();
  ASSERT_TRUE(captured_logs("take: kendo-07 is signed, after its recovery")) << log();
  EXPECT_TRUE(becomes_true([&] { return value("cap01", "takes_to_sign") == 0; }, within(60)));
  const auto reconstruction_has_closed_its_file = [&] {
    const auto health = client_->health(within(5));
    return std::ranges::all_of(
        health, [](const auto& node) { return node.second.state == wire::NodeState::kIdle; });
  };
  ASSERT_TRUE(becomes_true(reconstruction_has_closed_its_file, within(60))) << log();

  const std::string late = "; signed after a recovery, not at the stop";
  collect();
  const std::string text = verify().second;
  EXPECT_THAT(text, AllOf(ContainsRegex("signed by cap01, key [^\n]*" + late),
                          Not(ContainsRegex("signed by cap02, key [^\n]*" + late)),
                          Not(HasSubstr("not every node and file has a signature"))));
}

}  // namespace
}  // namespace v3d
