// Scenario tests of three nodes that share the reconstruction, each on its own host, and one
// capture node with fifteen simulated cameras. The tests compare the written and published meshes
// with the ledger of the cameras, so a slow machine causes no failure.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <csignal>
#include <nlohmann/json.hpp>
#include <numeric>
#include <set>

#include "base/io/file.h"
#include "daemon/bus/bus.h"
#include "daemon/control/operator_client.h"
#include "support/child_process.h"
#include "support/host_network.h"
#include "support/lossy_switch.h"
#include "support/temporary_folder.h"
#include "take/logs/mesh_file.h"
#include "take/take.h"
#include "wire/messages.h"

namespace v3d {
namespace {

using test::becomes_true;
using test::ChildProcess;
using test::within;

using Pulses = std::vector<int64_t>;
using Json = nlohmann::json;

constexpr char kTake[] = "kendo-07";
constexpr int kNodes = 3;
constexpr int64_t kRateHz = 8;

/// Receives all messages on V3D_MESH, as a viewer does.
class MeshViewer {
 public:
  MeshViewer(const std::string& url, const std::filesystem::path& key)
      : bus_(url), meshes_(key_of(key), wire::kMeshChannel, 10'000) {}

  /// Receives all pending meshes. A viewer shows pulses in ascending order. Other meshes were
  /// published twice, or too late.
  void receive() {
    while (const auto mesh = meshes_.wait(Monotonic::now())) {
      if (shown_.empty() || mesh->pulse > shown_.back()) {
        shown_.push_back(mesh->pulse);
      } else {
        late_.push_back(mesh->pulse);
      }
    }
  }
  const Pulses& shown() const { return shown_; }
  const Pulses& late() const { return late_; }
  /// Was the mesh of `pulse` received, in order or not?
  bool has_received(int64_t pulse) const {
    return std::ranges::binary_search(shown_, pulse) ||
           std::ranges::find(late_, pulse) != late_.end();
  }
  int64_t lost() const { return meshes_.counts().lost; }

 private:
  bus::Bus& key_of(const std::filesystem::path& key) {
    bus_.authenticator().set_key(wire::StudioKey::load(key));
    return bus_;
  }

  bus::Bus bus_;
  bus::Subscription<wire::MeshMessage> meshes_;
  Pulses shown_;
  Pulses late_;
};

class SharedStudio : public testing::Test {
 protected:
  /// `frame_groups` as in the studio file.
  explicit SharedStudio(const std::string& frame_groups = "[]") : switch_(network_.ports(), {}) {
    start_cameras();
    write_studio_files(frame_groups);
    start_at(
        0, {bin("v3d-captured"), "--studio", folder_ / "cap01" / "studio.toml", "--node", "cap01"},
        "cap01");
    for (int i = 0; i < kNodes; ++i) start_recond(i);
    const Studio studio = load_studio(folder_ / "cap01" / "studio.toml");
    client_.emplace(studio);
    viewer_.emplace(studio.network.lcm_url, studio.network.key);
    const control::Answer learnt = command(wire::CommandVerb::kBackground, 8);
    if (!learnt.done()) throw std::runtime_error("background: " + text_of(learnt));
  }

  static std::string bin(const std::string& program) {
    return std::string(V3D_BIN) + "/" + program;
  }
  static std::string node(int i) { return "recon0" + std::to_string(i + 1); }

  std::unique_ptr<ChildProcess> start_at(size_t host, const std::vector<std::string>& command,
                                         const std::string& name, bool keep = true) {
    std::vector<std::string> all = network_.enter(host);
    all.insert(all.end(), command.begin(), command.end());
    auto process = std::make_unique<ChildProcess>(all, folder_ / (name + ".log"));
    if (!keep) return process;
    others_.push_back(std::move(process));
    return nullptr;
  }
  void start_recond(int i) {
    reconds_[i] = start_at(
        static_cast<size_t>(i) + 1,
        {bin("v3d-recond"), "--studio", folder_ / node(i) / "studio.toml", "--node", node(i)},
        node(i), false);
  }
  void start_cameras() {
    start_at(0,
             {bin("v3d-sim"), "studio", folder_ / "cap01", "--cameras", "15", "--size", "160x120",
              "--rate", std::to_string(kRateHz), "--loop-frames", "8", "--empty-pulses", "8",
              "--voxel", "40mm"},
             "sim");
    ChildProcess& simulator = *others_.front();
    const bool serves = becomes_true(
        [&] { return simulator.output().find("ready\n") != std::string::npos; }, within(60));
    if (!serves) throw std::runtime_error("v3d-sim: " + simulator.output());
  }
  /// Writes the studio file into a folder for each node, with its own takes.
  void write_studio_files(const std::string& frame_groups) {
    std::string text = read_file(folder_ / "cap01" / "studio.toml");
    const auto replace = [&](const std::string& from, const std::string& to) {
      const size_t at = text.find(from);
      ASSERT_NE(at, std::string::npos) << from;
      text.replace(at, from.size(), to);
    };
    replace("[[node]]\nname = \"recon01\"",
            "[[node]]\nname = \"recon01\"\n[[node]]\nname = \"recon02\"\n[[node]]\nname = "
            "\"recon03\"");
    replace("node = \"recon01\"", "nodes = [\"recon01\", \"recon02\", \"recon03\"]\nthreads = 1");
    replace("ttl=0", "ttl=1");
    replace("[network]\n", "[network]\nframe_groups = " + frame_groups + "\n");
    for (const char* file : {"trigger.sock", "studio.key"}) {
      replace("\"" + std::string(file) + "\"", "\"" + (folder_ / "cap01" / file).string() + "\"");
    }
    test::write_text(folder_ / "cap01" / "studio.toml", text);
    for (int i = 0; i < kNodes; ++i) {
      std::filesystem::create_directory(folder_ / node(i));
      std::filesystem::copy(folder_ / "cap01" / "calib.toml", folder_ / node(i) / "calib.toml");
      test::write_text(folder_ / node(i) / "studio.toml", text);
    }
  }

  control::Answer command(wire::CommandVerb verb, int64_t pulses = 0, int seconds = 60) {
    wire::CommandMessage order;
    order.verb = verb;
    order.take = kTake;
    order.pulses = pulses;
    return client_->command(order, within(seconds));
  }
  std::string text_of(const control::Answer& answer) const {
    std::string text;
    for (const auto& [name, reply] : answer.replies) text += name + ": " + reply.text + "\n";
    for (const std::string& name : answer.silent) text += name + ": silent\n";
    for (int i = 0; i < kNodes; ++i) text += reconds_[i]->output();
    return text;
  }
  void arm_and_start() {
    const control::Answer armed = command(wire::CommandVerb::kArm);
    ASSERT_TRUE(armed.done()) << text_of(armed);
    const control::Answer started = command(wire::CommandVerb::kStart);
    ASSERT_TRUE(started.done()) << text_of(started);
  }

  double value(const std::string& sender, const std::string& name) {
    viewer_->receive();
    while (client_->next_health(Monotonic::now())) {
    }
    const auto health = client_->health(within(2));
    const auto found = health.find(sender);
    if (found == health.end() || !found->second.values.contains(name)) return -1;
    return found->second.values.at(name);
  }
  double value(int i, const std::string& name) { return value(node(i), name); }
  void wait_for(int i, const std::string& name, double wanted) {
    ASSERT_TRUE(becomes_true([&] { return value(i, name) >= wanted; }, within(120)))
        << node(i) << " " << name << " " << value(i, name) << "\n"
        << reconds_[i]->output();
  }
  /// Waits until node `i` has made `meshes` more meshes.
  void wait_for_more_meshes(int i, double meshes) {
    wait_for(i, "meshes", value(i, "meshes") + meshes);
  }

  void kill_node(int i) {
    reconds_[i]->signal(SIGKILL);
    ASSERT_TRUE(reconds_[i]->wait(within(30)));
    client_.emplace(load_studio(folder_ / "cap01" / "studio.toml"));  // drops its health
  }
  /// Sends "stop" until every node except the `dead` ones has replied "done". While a node is dead,
  /// each command waits its full 8 s; a busy machine may need several commands.
  void stop(const std::vector<std::string>& dead = {}) {
    const auto living_are_done = [&] {
      stopped_ = command(wire::CommandVerb::kStop, 0, dead.empty() ? 60 : 8);
      return stopped_.silent == dead &&
             std::ranges::all_of(stopped_.replies, [](const auto& reply) {
               return reply.second.outcome == wire::ReplyMessage::Outcome::kDone;
             });
    };
    ASSERT_TRUE(becomes_true(living_are_done, within(100))) << text_of(stopped_);
    viewer_->receive();
  }

  // --- checks of the result
  // -----------------------------------------------------------------------

  /// Number of commanded pulses, and of pulses without live frames: a busy capture node skips some.
  int64_t commanded() const { return ledger()["pulses"]["commanded"].get<int64_t>(); }
  int64_t not_live() const {
    int64_t missing = 0;
    for (const int64_t published : published_by_camera()) {
      missing = std::max(missing, commanded() - published);
    }
    return missing;
  }
  Pulses published_by_camera() const {
    Pulses published;
    const Json capture_ledger = ledger();
    for (const auto& camera : capture_ledger["cameras"]) published.push_back(camera["published"]);
    return published;
  }
  Json ledger() const { return Json::parse(stopped_.replies.at("cap01").detail); }
  Json account(int i) const { return Json::parse(stopped_.replies.at(node(i)).detail); }
  /// Pulses of the mesh file of node `i`.
  Pulses file(int i) const {
    take::MeshFileReader reader(take::TakePaths{folder_ / node(i) / kTake}.mesh());
    for (const int64_t pulse : reader.pulses()) EXPECT_TRUE(reader.read(pulse).value()) << pulse;
    return reader.pulses();
  }
  static Pulses range(int64_t first, int64_t end) {
    Pulses pulses;
    for (int64_t pulse = first; pulse < end; ++pulse) pulses.push_back(pulse);
    return pulses;
  }
  /// Number of pulses that the living nodes dropped for lack of time.
  int64_t dropped() const {
    int64_t dropped = 0;
    for (const auto& [name, reply] : stopped_.replies) {
      if (name != "cap01") dropped += Json::parse(reply.detail)["dropped"].get<int64_t>();
    }
    return dropped;
  }
  /// Every pulse is once in the mesh file, in order, or listed as without a mesh. At most
  /// `max_lost` pulses are lost. Pulses dropped for lack of time are counted separately; a node for
  /// which another one owned the pulse counts it as lost. Pulses at the end of the train without
  /// any live frame are unknown to the reconstruction.
  void expect_complete(int i, int64_t max_lost) const {
    const Pulses meshes = file(i);
    EXPECT_EQ(std::ssize(meshes), account(i)["meshes"].get<int64_t>()) << node(i);
    Pulses all = account(i)["without_mesh"].get<Pulses>();
    const auto lost = account(i)["shard_lost"].get<int64_t>();
    const auto given_up = account(i)["shard_given_up"].get<int64_t>();
    std::printf("%s: %zd meshes, %lld pulses lost, %lld given up, %lld dropped, %lld not live\n",
                node(i).c_str(), std::ssize(meshes), static_cast<long long>(lost),
                static_cast<long long>(given_up), static_cast<long long>(dropped()),
                static_cast<long long>(not_live()));
    EXPECT_LE(lost, max_lost + not_live() + dropped()) << node(i) << testing::PrintToString(all);
    EXPECT_EQ(std::ssize(all), lost + given_up) << "all are listed";
    EXPECT_TRUE(given_up == 0 || dropped() > 0) << "a node that gives pulses up reports the reason";
    for (const int64_t pulse : all) EXPECT_EQ(std::count(meshes.begin(), meshes.end(), pulse), 0);
    all.insert(all.end(), meshes.begin(), meshes.end());
    std::sort(all.begin(), all.end());
    EXPECT_EQ(all, range(0, std::ssize(all))) << node(i);
    EXPECT_GE(std::ssize(all), commanded() - not_live()) << node(i);
  }
  /// The published meshes are those in the file of node `i`, except for those lost on the network,
  /// which are counted, and those of which another node, the publisher, lists that it has none. The
  /// last mesh of a killed node may have reached the publisher only; node `i` then lists it as
  /// lost.
  void expect_published_as_in_file(int i) {
    const Pulses meshes = file(i);
    Pulses accounted = account(i)["without_mesh"].get<Pulses>();
    accounted.insert(accounted.end(), meshes.begin(), meshes.end());
    Pulses unpublished;
    const auto has_all = [&] {  // the last mesh may come after the reply to the stop
      viewer_->receive();
      unpublished = meshes;
      std::erase_if(unpublished, [&](int64_t pulse) {
        return viewer_->has_received(pulse) || a_node_has_no_mesh_of(pulse);
      });
      return std::ssize(unpublished) <= viewer_->lost();
    };
    EXPECT_TRUE(becomes_true(has_all, within(30))) << testing::PrintToString(unpublished);
    EXPECT_THAT(viewer_->shown(), testing::IsSubsetOf(accounted));
  }

  bool a_node_has_no_mesh_of(int64_t pulse) const {
    return std::ranges::any_of(stopped_.replies, [&](const auto& reply) {
      if (reply.first == "cap01") return false;
      const auto without = Json::parse(reply.second.detail)["without_mesh"].template get<Pulses>();
      return std::ranges::find(without, pulse) != without.end();
    });
  }

  /// True when nodes made meshes of pulses of a node that was silent for a while.
  bool was_taken_over() const {
    bool taken_over = false;
    for (int i = 0; i < kNodes; ++i) taken_over |= account(i)["shard_taken_over"] > 0;
    return taken_over;
  }
  /// The files of two nodes hold the same pulses, except for those that either lists as without a
  /// mesh.
  void expect_same_files_but_for_lost(int i, int k) const {
    std::set<int64_t> lost;
    for (const int index : {i, k}) {
      for (const int64_t pulse : account(index)["without_mesh"].get<Pulses>()) lost.insert(pulse);
    }
    const auto kept = [&](int index) {
      Pulses pulses = file(index);
      std::erase_if(pulses, [&](int64_t pulse) { return lost.contains(pulse); });
      return pulses;
    };
    EXPECT_EQ(kept(i), kept(k)) << node(i) << " and " << node(k);
  }

  /// Kills recon03 during a take. The other nodes take over its share, and have or list every
  /// pulse. `max_lost`: pulses that may be lost with it.
  void kill_third_node_in_take(int64_t max_lost) {
    arm_and_start();
    wait_for(2, "shard_pulses", 8);
    kill_node(2);
    wait_for_more_meshes(0, 40);
    stop({"recon03"});
    for (const int i : {0, 1}) {
      expect_complete(i, max_lost);
      expect_published_as_in_file(i);
      EXPECT_GE(account(i)["shard_taken_over"].get<int64_t>(), 3);
    }
  }

  const test::TemporaryFolder folder_;
  const test::HostNetwork network_{1 + kNodes};
  test::LossySwitch switch_;
  std::vector<std::unique_ptr<ChildProcess>> others_;
  std::array<std::unique_ptr<ChildProcess>, kNodes> reconds_;
  std::optional<control::OperatorClient> client_;
  std::optional<MeshViewer> viewer_;
  control::Answer stopped_;
};

TEST_F(SharedStudio, makes_one_mesh_of_every_pulse_and_publishes_them_in_order) {
  arm_and_start();
  wait_for(0, "meshes", 60);
  stop();
  int64_t made = 0, taken_over = 0;
  for (int i = 0; i < kNodes; ++i) {
    expect_complete(i, 0);
    expect_published_as_in_file(i);
    EXPECT_EQ(file(i), file(0));
    EXPECT_GE(account(i)["shard_pulses"].get<int64_t>(), 10) << "its share";
    EXPECT_EQ(account(i)["shard_let_go"], 0);
    made += account(i)["shard_pulses"].get<int64_t>();
    taken_over += account(i)["shard_taken_over"].get<int64_t>();
  }
  if (taken_over == 0) {
    EXPECT_EQ(viewer_->late(), Pulses()) << "no mesh comes twice";
  }
  EXPECT_GE(made, std::ssize(file(0)));
}

TEST_F(SharedStudio, loses_no_pulse_when_a_node_is_killed) {
  kill_third_node_in_take(0);
  const Pulses of_killed = file(2);
  ASSERT_FALSE(of_killed.empty());
  std::set<int64_t> known(of_killed.begin(), of_killed.end());
  for (const int64_t pulse : account(0)["without_mesh"].get<Pulses>()) {
    if (pulse < of_killed.back()) known.insert(pulse);
  }
  EXPECT_EQ(Pulses(known.begin(), known.end()), range(0, of_killed.back() + 1))
      << "the file of the killed node lacks only pulses of which no node has a mesh";
}

TEST_F(SharedStudio, continues_to_publish_when_the_publishing_node_is_killed) {
  arm_and_start();
  wait_for(0, "shard_pulses", 8);
  kill_node(0);
  wait_for_more_meshes(1, 40);
  stop({"recon01"});
  for (const int i : {1, 2}) {
    expect_complete(i, kRateHz);
    expect_published_as_in_file(i);
  }
}

TEST_F(SharedStudio, gives_a_share_to_a_node_that_was_killed_and_restarted) {
  arm_and_start();
  wait_for(0, "shard_pulses", 6);
  kill_node(0);
  wait_for_more_meshes(1, 16);
  start_recond(0);
  wait_for(0, "shard_pulses", 6);
  wait_for_more_meshes(1, 16);
  stop();
  for (const int i : {1, 2}) {
    expect_complete(i, kRateHz);
    expect_published_as_in_file(i);
  }
  const Pulses rejoined = file(0);
  EXPECT_THAT(rejoined, testing::IsSubsetOf(file(1)));
  EXPECT_GE(account(0)["shard_pulses"].get<int64_t>(), 6) << "since its restart";
  EXPECT_TRUE(std::is_sorted(rejoined.begin(), rejoined.end()));
  EXPECT_EQ(rejoined.back(), file(1).back());
}

/// SharedStudio with one multicast group for the frames of each node.
class SharedStudioInGroups : public SharedStudio {
 protected:
  SharedStudioInGroups()
      : SharedStudio(R"(["udpm://239.255.76.68:7668?ttl=1&recv_buf_size=4194304",
                "udpm://239.255.76.69:7669?ttl=1&recv_buf_size=4194304",
                "udpm://239.255.76.70:7670?ttl=1&recv_buf_size=4194304"])") {}

  /// Frames that a node has received, by the values of its health or of its reply.
  static double frames_received(const Json& values) {
    double frames = 0;
    for (const auto& [name, number] : values.items()) {
      if (name.ends_with(".live_received")) frames += number.get<double>();
    }
    return frames;
  }
  double frames_received(int i) {
    return frames_received(Json(client_->health(within(2)).at(node(i)).values));
  }
};

TEST_F(SharedStudioInGroups,
       makes_one_mesh_of_every_pulse_where_each_host_receives_only_its_own_frames) {
  arm_and_start();
  wait_for(0, "meshes", 20);
  const std::array before = {frames_received(0), frames_received(1), frames_received(2)};
  const double pulses_before = value("cap01", "pulses_commanded");
  wait_for(0, "meshes", 120);
  stop();
  // A busy machine may give a node no time for 0.4 s. The others then take it for dead: they lack
  // the frames of its pulses, and receive its group meanwhile.
  const bool was_silent = was_taken_over();
  const double pulses = static_cast<double>(commanded()) - pulses_before;
  EXPECT_GT(pulses, 6 * kRateHz) << "too few to tell a third from all";
  for (int i = 0; i < kNodes; ++i) {
    expect_complete(i, was_silent ? kRateHz : 0);
    expect_published_as_in_file(i);
    if (was_silent) {
      expect_same_files_but_for_lost(i, 0);
    } else {
      EXPECT_EQ(file(i), file(0));
    }
    if (!was_silent) {
      EXPECT_EQ(account(i)["frames_lost"], 0) << "frames of other groups do not count as lost";
      // Those of a third of the pulses; health is up to a second old, so two seconds are uncertain.
      EXPECT_LT(frames_received(account(i)) - before[i], 15 * (pulses / 3 + 2 * kRateHz))
          << node(i);
    }
  }
  const auto live = commanded() - static_cast<int64_t>(value("cap01", "pulses_not_live"));
  const Pulses all = published_by_camera();
  EXPECT_GE(std::accumulate(all.begin(), all.end(), int64_t{0}), 14 * live) << "frames";
}

TEST_F(SharedStudioInGroups, loses_at_most_a_second_of_pulses_of_a_killed_node_and_names_them) {
  kill_third_node_in_take(kRateHz);
}

TEST_F(SharedStudio, rejects_a_second_node_in_a_folder_of_takes) {
  ChildProcess second(
      {bin("v3d-recond"), "--studio", folder_ / "recon01" / "studio.toml", "--node", "recon02"},
      folder_ / "second.log");
  EXPECT_EQ(second.wait(within(30)), 2);
  EXPECT_THAT(second.output(), testing::HasSubstr("recon01 writes its takes here already"));
}

}  // namespace
}  // namespace v3d
