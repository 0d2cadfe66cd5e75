#include "v3dctl/operate/reply_text.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <random>

#include "daemon/control/reply_json.h"

namespace v3d::ctl {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::EndsWith;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;
using testing::StartsWith;
using Outcome = wire::ReplyMessage::Outcome;

wire::ReplyMessage reply(Outcome outcome, const std::string& text, const std::string& detail = "") {
  wire::ReplyMessage message;
  message.outcome = outcome;
  message.text = text;
  message.detail = detail;
  return message;
}

const std::vector<std::string> kNodes = {"cap01", "cap02", "cap03"};

TEST(ReplyLines, share_a_line_where_neighbours_reply_the_same) {
  control::Answer answer;
  for (const char* node : {"cap01", "cap02"}) answer.replies[node] = reply(Outcome::kDone, "quiet");
  answer.replies["cap03"] = reply(Outcome::kRefused, "not ready: cam07 silent");
  EXPECT_THAT(reply_lines(kNodes, answer, "ready"),
              ElementsAre("cap01-cap02   ready    quiet", "cap03         not ready: cam07 silent"));
}

TEST(ReplyLines, name_every_silent_node_with_the_next_step) {
  control::Answer answer;
  answer.replies["cap02"] = reply(Outcome::kDone, "quiet");
  answer.silent = {"cap01", "cap03"};
  const auto lines = reply_lines(kNodes, answer, "ready");
  ASSERT_EQ(lines.size(), 3U);
  EXPECT_THAT(lines[0], AllOf(StartsWith("cap01 "),
                              EndsWith("no reply. Try: systemctl status --all 'v3d-*' on cap01")));
  EXPECT_THAT(lines[2], StartsWith("cap03 "));
}

TEST(ReplyLines, show_the_health_text_of_a_node_that_does_not_reply) {
  control::Answer answer;
  answer.silent = {"cap01", "cap02"};
  wire::HealthMessage keyless;
  keyless.text = "every command is rejected: no studio key";
  const auto lines = reply_lines(kNodes, answer, "ready", {{"cap01", keyless}, {"cap02", {}}});
  ASSERT_EQ(lines.size(), 2U) << "cap03 was not asked";
  EXPECT_THAT(lines[0], HasSubstr("no reply to commands: every command is rejected"));
  EXPECT_THAT(lines[1], HasSubstr("but health messages"));
}

std::string detail(const std::string& camera, int missing) {
  Json cameras = Json::array();
  cameras.push_back(
      {{"name", camera}, {"received", 10}, {"written", 10 - missing}, {"published", 10}});
  if (missing) cameras[0]["missing"] = {4};
  return Json({{"take", "kendo"},
               {"pulses", {{"commanded", 10}, {"sensed", 10}}},
               {"cameras", cameras}})
      .dump();
}

TEST(TakeAccounts, have_the_cameras_of_all_nodes) {
  control::Answer answer;
  answer.replies["cap01"] = reply(Outcome::kDone, "", detail("cam01", 0));
  answer.replies["cap02"] = reply(Outcome::kDone, "", detail("cam02", 0));
  answer.replies["recon"] = reply(Outcome::kDone, "", "{\"meshes\": 10}");
  const TakeAccount account = merge_ledgers(answer);
  EXPECT_EQ(account.ledger.cameras.size(), 2U);
  EXPECT_TRUE(account.ledger.complete());
  EXPECT_EQ(account.ledger.take, "kendo");
  EXPECT_TRUE(account.unreadable.empty());
}

TEST(TakeAccounts, name_a_node_with_impossible_counts) {
  for (const char* count : {"-1", "1e300", "\"ten\"", "null"}) {
    std::string text = detail("cam01", 0);
    const std::string right = "\"commanded\":10";
    text.replace(text.find(right), right.size(), std::string("\"commanded\":") + count);
    control::Answer answer;
    answer.replies["cap01"] = reply(Outcome::kDone, "", text);
    EXPECT_THAT(merge_ledgers(answer).unreadable, ElementsAre("cap01")) << count;
  }
}

TEST(TakeAccounts, are_incomplete_when_one_camera_is) {
  control::Answer answer;
  answer.replies["cap01"] = reply(Outcome::kDone, "", detail("cam01", 0));
  answer.replies["cap02"] = reply(Outcome::kDone, "", detail("cam02", 1));
  const take::Ledger ledger = merge_ledgers(answer).ledger;
  EXPECT_FALSE(ledger.complete());
  EXPECT_THAT(ledger.cameras[1].missing, ElementsAre(4));
}

TEST(TakeAccounts, keep_a_number_of_pulses_that_is_a_minimum) {
  take::Ledger recovered;
  recovered.take = "kendo";
  recovered.commanded = 10;
  for (const bool is_minimum : {false, true}) {
    recovered.commanded_is_minimum = is_minimum;
    control::Answer answer;
    answer.replies["cap01"] = reply(Outcome::kDone, "", control::ledger_json(recovered));
    EXPECT_EQ(merge_ledgers(answer).ledger.commanded_is_minimum, is_minimum);
  }
}

TEST(TakeAccounts, have_the_problems_of_the_sound_of_every_node) {
  control::Answer answer;
  for (const std::string node : {"cap01", "cap02"}) {
    take::Ledger ledger;
    ledger.take = "kendo";
    ledger.sounds.push_back({.file = "sound/" + node + ".wav", .node = node});
    ledger.sounds[0].samples = 172'800'000;
    ledger.sounds[0].map_source = "time stamps";
    ledger.sounds[0].missing_edges = 30'000;
    answer.replies[node] = reply(Outcome::kDone, "", control::ledger_json(ledger));
  }
  const TakeAccount account = merge_ledgers(answer);
  EXPECT_THAT(account.unreadable, IsEmpty());
  EXPECT_THAT(problem_lines(account.ledger),
              ElementsAre("sound/cap01.wav: 30,000 pulses without an edge in the sound",
                          "sound/cap02.wav: 30,000 pulses without an edge in the sound"));
  EXPECT_EQ(to_json(account.ledger).at("sounds").size(), 2U);
}

TEST(TakeAccounts, have_the_nodes_of_whose_sound_nothing_was_recorded) {
  control::Answer answer;
  for (const std::string node : {"cap01", "cap02"}) {
    take::Ledger ledger;
    ledger.take = "kendo";
    ledger.nodes_without_sound = {node};
    answer.replies[node] = reply(Outcome::kDone, "", control::ledger_detail(ledger));
  }
  const TakeAccount account = merge_ledgers(answer);
  EXPECT_THAT(account.unreadable, IsEmpty());
  EXPECT_THAT(problem_lines(account.ledger), ElementsAre("sound of cap01: nothing was recorded",
                                                         "sound of cap02: nothing was recorded"));
  EXPECT_EQ(to_json(account.ledger).at("nodes_without_sound").size(), 2U);
  EXPECT_FALSE(to_json(take::Ledger()).contains("nodes_without_sound"));
}

TEST(TakeAccounts, count_every_pulse_as_missing_for_a_camera_without_a_ledger) {
  control::Answer answer;
  answer.replies["cap01"] = reply(Outcome::kDone, "", detail("cam01", 0));
  const take::Ledger ledger = merge_ledgers(answer, {"cam01", "cam02"}).ledger;
  ASSERT_EQ(ledger.cameras.size(), 2U);
  EXPECT_FALSE(ledger.complete());
  for (const take::CameraLedger& camera : ledger.cameras) {
    EXPECT_EQ(camera.missing.size(), camera.name == "cam02" ? 10U : 0U);
  }
}

/// A ledger of 15 cameras, with these missing pulses each.
take::Ledger ledger_of_15(const std::vector<int64_t>& missing, int64_t commanded) {
  take::Ledger ledger;
  ledger.take = "kendo";
  ledger.commanded = ledger.sensed.emplace(commanded);
  for (int n = 1; n <= 15; ++n) {
    take::CameraLedger& camera = ledger.cameras.emplace_back();
    camera.name = "cam" + std::to_string(n);
    camera.received = camera.exposed = camera.written = commanded - std::ssize(missing);
    camera.missing = missing;
  }
  return ledger;
}

/// Every `step`-th pulse of an hour at 60 Hz.
std::vector<int64_t> pulses_of_an_hour(int64_t step) {
  std::vector<int64_t> pulses;
  for (int64_t pulse = 0; pulse < 216'000; pulse += step) pulses.push_back(pulse);
  return pulses;
}

TEST(TakeAccounts, of_an_hour_without_frames_fit_into_a_reply) {
  constexpr size_t kMaxReply = 1 << 20;
  for (const int64_t step : {1, 2, 3}) {
    const std::vector<int64_t> missing = pulses_of_an_hour(step);
    take::Ledger ledger = ledger_of_15(missing, 216'000);
    ledger.unsensed = ledger.runt = missing;
    ledger.cameras[3].suspect = ledger.cameras[4].duplicate = missing;
    control::Answer answer;
    answer.replies["cap01"] = reply(Outcome::kDone, "", control::ledger_detail(ledger));
    EXPECT_LT(answer.replies["cap01"].detail.size(), kMaxReply) << step;
    const TakeAccount account = merge_ledgers(answer);
    EXPECT_THAT(account.unreadable, IsEmpty());
    EXPECT_TRUE(account.ledger.cameras == ledger.cameras) << step;
    EXPECT_TRUE(account.ledger.unsensed == missing && account.ledger.runt == missing) << step;
    const Json replied = answer_json(answer)["replies"][0]["detail"];
    EXPECT_TRUE(replied == to_json(ledger)) << "lists in --json are never packed";
  }
}

TEST(TakeAccounts, of_short_takes_are_replied_as_earlier_versions_read_them) {
  const take::Ledger ledger = ledger_of_15({4, 5, 9}, 10);
  EXPECT_EQ(control::ledger_detail(ledger), control::ledger_json(ledger));
  EXPECT_EQ(control::recon_json({{"meshes", 7}}, {4, 5, 9}),
            "{\"meshes\":7.0,\"without_mesh\":[4,5,9]}");
}

TEST(TakeAccounts, that_are_too_long_for_a_reply_name_their_node) {
  std::vector<int64_t> missing;  // without a pattern, so that nothing packs them
  for (std::minstd_rand random; missing.size() < 1'000'000;) {
    missing.push_back((missing.empty() ? 0 : missing.back()) + 1 +
                      static_cast<int64_t>(random() % 3));
  }
  control::Answer answer;
  const std::string detail = control::ledger_detail(ledger_of_15(missing, 2'000'000));
  EXPECT_LE(detail.size(), control::kMaxDetailBytes);
  answer.replies["cap01"] = reply(Outcome::kDone, "", detail);
  for (const std::vector<std::string>& expected : {std::vector<std::string>(), {"cam1", "cam2"}}) {
    const TakeAccount account = merge_ledgers(answer, expected);
    EXPECT_THAT(account.unreadable, ElementsAre("cap01"));
    EXPECT_FALSE(is_whole(account, answer));
    EXPECT_THAT(account_lines(account),
                ElementsAre("take kendo: no ledger can be read; v3dctl verify, on each node, lists "
                            "its frames"));
    EXPECT_THAT(account.ledger.verdict(), StartsWith("take kendo: incomplete"));
  }
}

TEST(TakeAccounts, of_a_node_with_a_reply_that_is_no_ledger_are_not_those_of_an_empty_take) {
  control::Answer answer;
  answer.replies["cap01"] = reply(Outcome::kDone, "", "{");
  EXPECT_FALSE(is_whole(merge_ledgers(answer), answer));
  EXPECT_THAT(account_lines(merge_ledgers(answer)), Not(ElementsAre("nothing was recorded")));
  answer.replies["cap01"] = reply(Outcome::kDone, "nothing was recorded");
  EXPECT_TRUE(is_whole(merge_ledgers(answer), answer));
  EXPECT_THAT(account_lines(merge_ledgers(answer)), ElementsAre("nothing was recorded"));
}

TEST(TakeAccounts, of_one_readable_ledger_count_the_other_cameras_as_missing) {
  control::Answer answer;
  answer.replies["cap01"] = reply(Outcome::kDone, "", detail("cam01", 0));
  EXPECT_TRUE(is_whole(merge_ledgers(answer), answer));
  answer.replies["cap02"] =
      reply(Outcome::kDone, "", "{\"take\": \"kendo\", \"complete\": false, \"cameras\": null}");
  const TakeAccount account = merge_ledgers(answer, {"cam01", "cam02"});
  EXPECT_FALSE(is_whole(account, answer));
  EXPECT_THAT(account_lines(account),
              ElementsAre("cam02: missing pulses 0-9",
                          "take kendo: incomplete, 2 cameras x 10 pulses, 10 missing, 0 suspect"));
}

/// cam01 and cam07 on cap01, cam02 on cap02.
Studio studio_of_two_capture_nodes() {
  Studio studio;
  studio.nodes = {{"cap01"}, {"cap02"}, {"recon01"}};
  studio.cameras.resize(3);
  studio.cameras[0].name = "cam01";
  studio.cameras[1].name = "cam02";
  studio.cameras[2].name = "cam07";
  studio.cameras[0].node = studio.cameras[2].node = "cap01";
  studio.cameras[1].node = "cap02";
  return studio;
}

/// As `v3dctl stop` merges an answer without the ledgers of all nodes.
TakeAccount account_of_partial(const control::Answer& answer) {
  return merge_ledgers(
      answer, cameras_without_ledger(studio_of_two_capture_nodes(), merge_ledgers(answer)));
}

TEST(TakeAccounts, are_complete_without_an_allowed_camera_when_a_node_without_cameras_is_silent) {
  control::Answer answer;
  answer.replies["cap01"] = reply(Outcome::kDone, "", detail("cam01", 0));
  answer.replies["cap02"] = reply(Outcome::kDone, "", detail("cam02", 0));
  answer.silent = {"recon01"};
  EXPECT_THAT(account_lines(account_of_partial(answer)),
              ElementsAre("take kendo: complete, 2 cameras x 10 pulses, 0 missing, 0 suspect"));
}

TEST(TakeAccounts, count_the_cameras_of_each_node_without_a_ledger_as_missing) {
  control::Answer silent;
  silent.replies["cap01"] = reply(Outcome::kDone, "", detail("cam01", 0));
  silent.silent = {"cap02"};
  control::Answer refused = silent;
  refused.silent.clear();
  refused.replies["cap02"] = reply(Outcome::kRefused, "not armed");
  control::Answer unreadable = refused;
  unreadable.replies["cap02"] = reply(Outcome::kDone, "", "{");
  for (const control::Answer& answer : {silent, refused, unreadable}) {
    EXPECT_THAT(account_lines(account_of_partial(answer)),
                ElementsAre("cam02: missing pulses 0-9",
                            "take kendo: incomplete, 2 cameras x 10 pulses, 10 missing, 0 suspect"))
        << "cam07 was left out when the take was armed";
  }
}

TEST(TakeAccounts, do_not_unpack_more_numbers_than_a_reply_may_name) {
  std::string text = detail("cam01", 1);
  text.replace(text.find("[4]"), 3, "\"0:9000000000\"");
  control::Answer answer;
  answer.replies["cap01"] = reply(Outcome::kDone, "", text);
  EXPECT_THAT(merge_ledgers(answer).unreadable, ElementsAre("cap01"));
}

TEST(TakeAccounts, unpack_the_pulses_without_a_mesh) {
  const std::vector<int64_t> without = pulses_of_an_hour(2);
  const std::string detail = control::recon_json(
      {{"meshes", 108'000}, {"shard_pulses", 108'000}, {"shard_taken_over", 0}}, without);
  EXPECT_LT(detail.size(), 100'000U);
  control::Answer answer;
  answer.replies["recon1"] = reply(Outcome::kDone, "", detail);
  EXPECT_TRUE(merge_ledgers(answer).without_mesh == without);
}

TEST(TakeAccounts, do_not_merge_different_takes) {
  std::string other = detail("cam03", 0);
  other.replace(other.find("kendo"), 5, "naginata");
  control::Answer answer;
  answer.replies["cap01"] = reply(Outcome::kDone, "", detail("cam01", 0));
  answer.replies["cap02"] = reply(Outcome::kDone, "", detail("cam02", 0));
  answer.replies["cap03"] = reply(Outcome::kDone, "", other);
  const TakeAccount account = merge_ledgers(answer);
  EXPECT_EQ(account.ledger.take, "kendo");
  EXPECT_EQ(account.ledger.cameras.size(), 2U);
  EXPECT_THAT(account.of_another_take, ElementsAre("cap03"));
}

TEST(TakeAccounts, count_live_frames_that_were_sent_and_not_received) {
  control::Answer answer;
  answer.replies["cap01"] = reply(Outcome::kDone, "", detail("cam01", 0));
  answer.replies["cap02"] = reply(Outcome::kDone, "", detail("cam02", 0));
  answer.replies["recon"] =
      reply(Outcome::kDone, "", "{\"cam01.live_received\": 10, \"cam02.live_received\": 7}");
  const TakeAccount account = merge_ledgers(answer);
  EXPECT_EQ(live_loss_line(account), "live: 3 of 20 frames lost on the network: cam02 3");
  answer.replies["recon"].detail = "{\"meshes\": 10}";
  EXPECT_EQ(live_loss_line(merge_ledgers(answer)), "")
      << "an older reconstruction does not report it";
}

TEST(TakeAccounts, have_no_live_losses_of_a_node_that_restarted_in_the_take) {
  control::Answer answer;
  answer.replies["cap01"] = reply(Outcome::kDone, "", detail("cam01", 0));
  answer.replies["cap02"] = reply(Outcome::kDone, "", detail("cam02", 0));
  answer.replies["recon"] =
      reply(Outcome::kDone, "", "{\"cam01.live_received\": 106, \"cam02.live_received\": 8}");
  const TakeAccount account = merge_ledgers(answer);
  EXPECT_EQ(live_loss_line(account), "live: 2 of 10 frames lost on the network: cam02 2");
  EXPECT_FALSE(account.live_lost.contains("cam01"));
}

TEST(TakeAccounts, count_the_meshes_of_a_sharded_take_once) {
  const auto shard = [](int meshes, int made, int taken_over, const std::string& without) {
    return reply(Outcome::kDone, "",
                 "{\"meshes\": " + std::to_string(meshes) +
                     ", \"shard_pulses\": " + std::to_string(made) +
                     ", \"shard_taken_over\": " + std::to_string(taken_over) +
                     ", \"cam01.live_received\": " + std::to_string(meshes) +
                     ", \"without_mesh\": [" + without + "]}");
  };
  control::Answer answer;
  answer.replies["cap01"] = reply(Outcome::kDone, "", detail("cam01", 0));
  answer.replies["recon1"] = shard(8, 3, 0, "4, 5");
  answer.replies["recon2"] = shard(2, 1, 0, "");  // it joined later
  answer.replies["recon3"] = shard(8, 4, 2, "4, 5");
  const TakeAccount account = merge_ledgers(answer);
  EXPECT_EQ(shards_line(account),
            "meshes: 8, recon1 3, recon2 1, recon3 4 (2 taken over); no mesh of 4-5");
  EXPECT_EQ(shards_json(account)["nodes"].size(), 3U);
  EXPECT_EQ(account.live_lost.at("cam01"), 2) << "of the node that received most";
  EXPECT_EQ(shards_line(TakeAccount{}), "") << "of one node";
}

TEST(TakeAccounts, name_a_node_whose_ledger_cannot_be_parsed) {
  for (const char* malformed :
       {"{", "[]", "7", "{\"cameras\": 3}", "{\"pulses\":{\"commanded\":\"ten\"},\"cameras\":[]}",
        "{\"take\":\"k\",\"pulses\":{\"commanded\":1,\"sensed\":1},\"cameras\":[{\"name\":7}]}"}) {
    control::Answer answer;
    answer.replies["cap01"] = reply(Outcome::kDone, "", malformed);
    EXPECT_THAT(merge_ledgers(answer).unreadable, ElementsAre("cap01")) << malformed;
  }
}

}  // namespace
}  // namespace v3d::ctl
