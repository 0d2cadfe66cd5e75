// Test fixture: a simulated studio of four small cameras (or more) with the real daemons.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "base/config/studio_file.h"
#include "base/io/file.h"
#include "daemon/control/operator_client.h"
#include "support/child_process.h"
#include "support/temporary_folder.h"
#include "take/take.h"
#include "wire/member_list.h"
#include "wire/signatures.h"

namespace v3d::test {

inline constexpr int kEmptyPulses = 12;

struct Studio4Options {
  int cameras = 4;
  std::string size = "320x240";
  std::string voxel = "40mm";
  /// Lines appended to the studio file, whose last section is [reconstruction].
  std::string more{};
  std::string network{};                 ///< lines added to the section [network]
  std::string faults{};                  ///< text of a fault script; empty: no faults
  std::string rate = "20";               ///< trigger, Hz
  std::vector<std::string> simulator{};  ///< further options of v3d-sim
  std::string takes = ".";               ///< folder of the takes
  bool is_signed = false;                ///< every node signs its takes
  /// The studio has a member list with the nodes and two operators. cap02 has its own key.
  bool has_members = false;
  bool two_nodes = false;  ///< cam03 and cam04 belong to cap02, whose storage folder is cap02/
};

/// Starts the simulator and the daemons, and learns the background.
///
/// The constructor throws std::runtime_error when the simulator or the background command fails.
class Studio4 : public testing::Test {
 protected:
  explicit Studio4(const Studio4Options& options = {}) {
    start_simulator(options);
    const bool serves = becomes_true(
        [&] { return simulator_->output().find("ready\n") != std::string::npos; }, within(60));
    if (!serves) throw std::runtime_error("v3d-sim: " + simulator_->output());
    std::ofstream(folder_ / "studio.toml", std::ios::app) << options.more;
    put_takes_into(options.takes);
    add_to_network(options.network);
    if (options.two_nodes) assign_cameras_to_two_nodes();
    if (options.is_signed) give_signing_keys(options.two_nodes);
    if (options.has_members) make_member_list(options.two_nodes);
    studio_ = load_studio(folder_ / "studio.toml");
    start_captured();
    if (options.two_nodes) start_second_captured();
    start_recond();
    client_.emplace(studio_);
    // A busy machine opens the cameras slowly, and the background waits 15 s for them.
    const int of_cap01 = options.cameras - (options.two_nodes ? 2 : 0);
    if (!reaches("cap01", "cameras_streaming", of_cap01))
      throw std::runtime_error("cameras: " + log());
    if (options.two_nodes && !reaches("cap02", "cameras_streaming", 2))
      throw std::runtime_error("cameras: " + log());
    wire::CommandMessage learn;
    learn.verb = wire::CommandVerb::kBackground;
    learn.pulses = kEmptyPulses;
    const control::Answer learnt = client_->command(learn, within(60));
    if (!learnt.done()) throw std::runtime_error("background: " + text_of(learnt) + log());
  }

  static std::string bin(const std::string& program) {
    return std::string(V3D_BIN) + "/" + program;
  }

  void put_takes_into(const std::string& folder) const {
    std::string text = read_file(folder_ / "studio.toml");
    const std::string before = "takes = \".\"";
    text.replace(text.find(before), before.size(), "takes = \"" + folder + "\"");
    write_text(folder_ / "studio.toml", text);
  }
  void add_to_network(const std::string& lines) const {
    std::string text = read_file(folder_ / "studio.toml");
    replace(text, "[network]\n", "[network]\n" + lines);
    write_text(folder_ / "studio.toml", text);
  }
  static void replace(std::string& text, const std::string& before, const std::string& after) {
    const size_t at = text.find(before);
    if (at == std::string::npos) throw std::runtime_error("no " + before + " in " + text);
    text.replace(at, before.size(), after);
  }
  /// Gives cam03 and cam04 to cap02. Both nodes get the same studio file, each in its own folder;
  /// trigger socket, studio key and calibration stay in the folder of cap01.
  void assign_cameras_to_two_nodes() const {
    std::string text = read_file(folder_ / "studio.toml");
    replace(text, "[camera_defaults]", "[[node]]\nname = \"cap02\"\n\n[camera_defaults]");
    for (const char* camera : {"cam03", "cam04"}) {
      const std::string name = "name = '" + std::string(camera) + "'";
      replace(text, name, name + "\nnode = \"cap02\"");
    }
    for (const char* file : {"trigger.sock", "studio.key", "calib.toml"}) {
      replace(text, "\"" + std::string(file) + "\"", "\"" + (folder_ / file).string() + "\"");
    }
    std::filesystem::create_directory(folder_ / "cap02");
    write_text(folder_ / "studio.toml", text);
    write_text(folder_ / "cap02" / "studio.toml", text);
  }
  /// Writes a signing key for each node, next to its studio file.
  void give_signing_keys(bool two_nodes) const {
    std::string text = read_file(folder_ / "studio.toml");
    const auto give = [&](const std::string& node, const std::filesystem::path& folder) {
      const wire::SigningKey key = wire::SigningKey::make();
      key.save(folder / "node.key");
      const std::string name = "name = \"" + node + "\"";
      replace(text, name, name + "\npublic_key = \"" + key.public_key().text() + "\"");
    };
    give("cap01", folder_.path());
    if (two_nodes) give("cap02", folder_ / "cap02");
    replace(text, "[storage]", "[storage]\nsigning_key = \"node.key\"");
    write_text(folder_ / "studio.toml", text);
    if (two_nodes) write_text(folder_ / "cap02" / "studio.toml", text);
  }
  /// cap01 and recon01 share the signing key of their PC. The operator Ada uses the key that the
  /// studio file names; the operator Bob uses bob.key.
  void make_member_list(bool two_nodes) {
    const wire::SigningKey pc = wire::SigningKey::make(), ada = wire::SigningKey::make(),
                           bob = wire::SigningKey::make();
    pc.save(folder_ / "node.key");
    ada.save(folder_ / "operator.key");
    bob.save(folder_ / "bob.key");
    std::string text = read_file(folder_ / "studio.toml");
    replace(text, "[network]",
            "[network]\nmembers = \"" + (folder_ / "members.toml").string() +
                "\"\noperator_key = \"operator.key\"\nauthority = \"" +
                authority_.public_key().text() + "\"");
    replace(text, "[storage]", "[storage]\nsigning_key = \"node.key\"");
    write_text(folder_ / "studio.toml", text);
    wire::MemberList list{.studio = load_studio(folder_ / "studio.toml").name,
                          .serial = 1,
                          .members = {{"cap01", wire::Role::kCapture, pc.public_key()},
                                      {"recon01", wire::Role::kReconstruction, pc.public_key()},
                                      {"ada", wire::Role::kOperator, ada.public_key()},
                                      {"bob", wire::Role::kOperator, bob.public_key()}}};
    if (two_nodes) {
      write_text(folder_ / "cap02" / "studio.toml", text);
      cap02_.save(folder_ / "cap02" / "node.key");
      list.members.push_back({"cap02", wire::Role::kCapture, cap02_.public_key()});
    }
    write_members(list);
  }
  void write_members(const wire::MemberList& list) {
    members_ = list;
    replace_file(folder_ / "members.toml", sign_member_list(list, authority_));
  }
  void start_simulator(const Studio4Options& options) {
    std::vector<std::string> command = {bin("v3d-sim"),
                                        "studio",
                                        folder_.path(),
                                        "--cameras",
                                        std::to_string(options.cameras),
                                        "--size",
                                        options.size,
                                        "--rate",
                                        options.rate,
                                        "--loop-frames",
                                        "10",
                                        "--empty-pulses",
                                        std::to_string(kEmptyPulses),
                                        "--voxel",
                                        options.voxel};
    command.insert(command.end(), options.simulator.begin(), options.simulator.end());
    if (!options.faults.empty()) {
      std::ofstream(folder_ / "faults.toml") << options.faults;
      command.insert(command.end(), {"--faults", folder_ / "faults.toml"});
    }
    simulator_.emplace(command, folder_ / "v3d-sim.log");
  }
  void start_captured() {
    captured_.emplace(std::vector<std::string>{bin("v3d-captured"), "--studio",
                                               folder_ / "studio.toml", "--node", "cap01"},
                      folder_ / "v3d-captured.log");
  }
  void start_second_captured() {
    second_captured_.emplace(
        std::vector<std::string>{bin("v3d-captured"), "--studio", folder_ / "cap02" / "studio.toml",
                                 "--node", "cap02"},
        folder_ / "v3d-captured-2.log");
  }
  /// Starts a second process with the name of cap01.
  void start_duplicate() {
    duplicate_.emplace(std::vector<std::string>{bin("v3d-captured"), "--studio",
                                                folder_ / "studio.toml", "--node", "cap01"},
                       folder_ / "duplicate.log");
  }
  static constexpr char kDuplicateAlarm[] = "another process sends as node cap01";
  /// Waits up to 60 s for the alarm in the health of cap01. False at timeout.
  bool raises_alarm() {
    return becomes_true(
        [&] {
          const auto health = client_->health(within(5));
          const auto cap01 = health.find("cap01");
          return cap01 != health.end() &&
                 cap01->second.text.find(kDuplicateAlarm) != std::string::npos;
        },
        within(60));
  }
  /// Waits up to 60 s until the second process has logged the alarm. False at timeout.
  bool duplicate_knows() const {
    return becomes_true(
        [&] { return duplicate_->output().find(kDuplicateAlarm) != std::string::npos; },
        within(60));
  }
  void start_recond() {
    recond_.emplace(
        std::vector<std::string>{bin("v3d-recond"), "--studio", folder_ / "studio.toml"},
        folder_ / "v3d-recond.log");
  }

  static std::string text_of(const control::Answer& answer) {
    std::string text;
    for (const auto& [node, reply] : answer.replies) text += node + ": " + reply.text + "\n";
    for (const std::string& node : answer.silent) text += node + ": silent\n";
    return text;
  }
  std::string log() const {
    const std::string second = second_captured_ ? second_captured_->output() : "";
    return captured_->output() + second + recond_->output();
  }

  control::Answer command(wire::CommandVerb verb, int64_t pulses = 0) {
    wire::CommandMessage m;
    m.verb = verb;
    m.take = take_name_;
    m.pulses = pulses;
    return client_->command(m, within(60));
  }
  void arm_and_start(int64_t pulses) {
    const control::Answer armed = command(wire::CommandVerb::kArm, pulses);
    ASSERT_TRUE(armed.done()) << text_of(armed) << log();
    const control::Answer started = command(wire::CommandVerb::kStart);
    ASSERT_TRUE(started.done()) << text_of(started) << log();
  }

  /// Runs `v3dctl ARGUMENTS`, expects exit status `status`, and returns the output.
  std::string run_v3dctl(const std::vector<std::string>& arguments, int status) {
    std::vector<std::string> line = {bin("v3dctl"), "--studio", folder_ / "studio.toml"};
    line.insert(line.end(), arguments.begin(), arguments.end());
    std::filesystem::remove(folder_ / "v3dctl.log");  // of an earlier call
    ChildProcess v3dctl(line, folder_ / "v3dctl.log");
    EXPECT_EQ(v3dctl.wait(within(60)), status) << v3dctl.output() << log();
    return v3dctl.output();
  }

  double value(const std::string& node, const std::string& name) {
    const auto health = client_->health(within(5));
    const auto found = health.find(node);
    if (found == health.end() || !found->second.values.contains(name)) return -1;
    return found->second.values.at(name);
  }
  /// Waits up to 60 s for health of `node` in which `name` is at least `wanted`. False at timeout.
  bool reaches(const std::string& node, const std::string& name, double wanted) {
    return becomes_true([&] { return value(node, name) >= wanted; }, within(60));
  }
  /// Waits up to 60 s until all nodes are idle, as after a train of known length. False at timeout.
  bool becomes_idle() {
    const auto idle = [&] {
      const auto health = client_->health(within(5));
      return health.size() == (second_captured_ ? 3U : 2U) &&
             std::ranges::all_of(health, [](const auto& entry) {
               return entry.second.state == wire::NodeState::kIdle;
             });
    };
    return becomes_true(idle, within(60));
  }

  take::TakePaths take() const { return {studio_.storage.takes / take_name_}; }
  /// With `two_nodes`.
  take::TakePaths take_of_cap02() const { return {folder_ / "cap02" / take_name_}; }

  const TemporaryFolder folder_;
  const wire::SigningKey authority_ = wire::SigningKey::make();
  const wire::SigningKey cap02_ = wire::SigningKey::make();  ///< used with `has_members`
  wire::MemberList members_;                                 ///< as last written
  std::string take_name_ = "kendo-07";
  std::optional<ChildProcess> simulator_;
  Studio studio_;
  std::optional<ChildProcess> captured_;
  std::optional<ChildProcess> second_captured_;
  std::optional<ChildProcess> duplicate_;  ///< a second process with the name of cap01
  std::optional<ChildProcess> recond_;
  std::optional<control::OperatorClient> client_;
};

}  // namespace v3d::test
