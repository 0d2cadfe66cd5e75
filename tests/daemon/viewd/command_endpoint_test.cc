// Orders of the studio page: who may give one, what is one, and how v3dctl is called for it.
#include "daemon/viewd/command_endpoint.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <sys/stat.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/name.h"
#include "daemon/viewd/child_program.h"
#include "daemon/viewd/page_files.h"
#include "daemon/viewd/studio_status.h"
#include "daemon/viewd/web_site.h"
#include "support/child_process.h"
#include "support/temporary_folder.h"

namespace v3d {
namespace {

using test::becomes_true;
using test::within;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using Json = nlohmann::json;
using Verb = OperatorCommand::Verb;

constexpr char kToken[] = "operators-0123456789";

Studio studio_of_two() {
  Studio studio;
  studio.trigger.rate_hz = 25;
  for (const char* name : {"cam01", "cam02"}) studio.cameras.emplace_back().name = name;
  return studio;
}

class Order : public testing::Test {
 protected:
  OperatorCommand read(const std::string& json) {
    const ReadOrder read = read_order(json, studio_);
    EXPECT_TRUE(read.order) << json << ": " << read.wrong;
    return read.order.value_or(OperatorCommand{});
  }
  std::string wrong(const std::string& json) {
    const ReadOrder read = read_order(json, studio_);
    EXPECT_FALSE(read.order) << json;
    return read.wrong;
  }
  const Studio studio_ = studio_of_two();
};

TEST_F(Order, is_v3dctl_with_fixed_words_and_harmless_names) {
  EXPECT_THAT(read(R"({"do": "start"})").words(),
              ElementsAre("start", "--json", "--timeout", "10"));
  EXPECT_THAT(read(R"({"do": "stop"})").words(), ElementsAre("stop", "--json", "--timeout", "60"));
  EXPECT_THAT(read(R"({"do": "abort"})").words(),
              ElementsAre("abort", "--json", "--timeout", "10"));
  EXPECT_THAT(read(R"({"do": "arm", "take": "kendo-07"})").words(),
              ElementsAre("arm", "--json", "--timeout", "30", "kendo-07"));
  EXPECT_THAT(read(R"({"do":"arm", "take":"kendo-07", "seconds":60, "without":["cam02", "cam01"]})")
                  .words(),
              ElementsAre("arm", "--json", "--timeout", "30", "--pulses", "1500", "--allow-missing",
                          "cam02,cam01", "kendo-07"));
}

TEST_F(Order, lasts_so_many_pulses_as_the_rate_of_the_studio_makes_of_the_seconds) {
  EXPECT_EQ(read(R"({"do":"arm", "take":"a", "seconds":0.5})").pulses, 13);
  EXPECT_EQ(read(R"({"do":"arm", "take":"a", "seconds":0.001})").pulses, 1);
  for (const char* seconds : {"0", "-1", "86401", "1e300", "\"60\"", "null", "[1]", "true"}) {
    EXPECT_THAT(wrong(R"({"do":"arm", "take":"a", "seconds":)" + std::string(seconds) + "}"),
                HasSubstr("seconds: expected"));
  }
}

TEST_F(Order, names_no_take_that_is_more_than_a_name) {
  for (const char* name :
       {"../x", "a/b", "", "-x", "--wait", ".x", "a b", "a;b", "$(a)", "a\\nb"}) {
    EXPECT_THAT(wrong(R"({"do":"arm", "take":")" + std::string(name) + "\"}"),
                HasSubstr("take: no name of a take"))
        << name;
  }
  EXPECT_THAT(wrong(R"({"do":"arm"})"), HasSubstr("take: missing"));
  EXPECT_THAT(wrong(R"({"do":"arm", "take": 7})"), HasSubstr("take: no name"));
}

TEST_F(Order, leaves_out_cameras_of_the_studio_only) {
  for (const char* cameras : {"[\"cam03\"]", "[\"--json\"]", "\"cam01\"", "[1]", "{}"}) {
    EXPECT_THAT(wrong(R"({"do":"arm", "take":"a", "without":)" + std::string(cameras) + "}"),
                HasSubstr("without: expected"));
  }
}

TEST_F(Order, is_nothing_else) {
  for (const char* odd : {"", "stop", "[]", "null", "{", "{}", R"({"do":"background"})",
                          R"({"do":["stop"]})", R"({"do":"STOP"})"}) {
    EXPECT_FALSE(wrong(odd).empty()) << odd;
  }
  EXPECT_THAT(wrong(R"({"do":"stop", "take":"a"})"), HasSubstr("take: not known to \"stop\""));
  EXPECT_THAT(wrong(R"({"do":"arm", "take":"a", "studio":"b"})"), HasSubstr("studio: not known"));
  EXPECT_FALSE(wrong(std::string(4000, '[')).empty()) << "however deep";
}

RC_GTEST_PROP(OrderText, gives_v3dctl_no_word_that_is_not_ours, (const std::string& take)) {
  const std::string json =
      Json{{"do", "arm"}, {"take", take}}.dump(-1, ' ', false, Json::error_handler_t::replace);
  const ReadOrder read = read_order(json, studio_of_two());
  RC_ASSERT(read.order.has_value() == is_file_name(take));
}

TEST(TokenThrottle, are_slowed_more_and_more_by_address) {
  TokenThrottle wrong;
  MonotonicInstant now = Monotonic::now();
  EXPECT_EQ(wrong.pause_of("a", now), Duration::zero());
  for (const int seconds : {1, 2, 4, 8, 16, 32, 60, 60}) {
    wrong.wrong("a", now);
    EXPECT_EQ(wrong.pause_of("a", now), std::chrono::seconds(seconds));
    EXPECT_EQ(wrong.pause_of("b", now), Duration::zero()) << "another has done nothing";
    now += std::chrono::seconds(seconds);
    EXPECT_EQ(wrong.pause_of("a", now), Duration::zero());
  }
  wrong.right("a");
  wrong.wrong("a", now);
  EXPECT_EQ(wrong.pause_of("a", now), TokenThrottle::kFirstPause);
}

TEST(TokenThrottle, of_many_addresses_are_counted_as_of_one) {
  TokenThrottle wrong;
  const MonotonicInstant now = Monotonic::now();
  for (int i = 0; i < 1000; ++i) wrong.wrong(std::to_string(i), now);
  EXPECT_EQ(wrong.pause_of("stranger", now), TokenThrottle::kLongestPause);
  EXPECT_EQ(wrong.pause_of("0", now), TokenThrottle::kFirstPause);
  const MonotonicInstant later = now + TokenThrottle::kForgottenAfter + std::chrono::seconds(1);
  wrong.wrong("somebody", later);
  EXPECT_EQ(wrong.pause_of("0", later), Duration::zero()) << "forgotten";
}

class Desk : public testing::Test {
 protected:
  static WebRequest order(const std::string& body) {
    return {.method = "POST",
            .target = "/api/order",
            .host = "127.0.0.1:8330",
            .origin = "http://127.0.0.1:8330",
            .content_type = "application/json",
            .operator_token = kToken,
            .address = "127.0.0.1",
            .body = body};
  }
  WebAnswer take(const WebRequest& request) {
    WebSite site(studio_, WebAccess(viewer_token_), {}, desk_);
    return site.answer(request);
  }
  /// What is refused carries nothing out.
  void expect_refused(const WebRequest& request, int status, const std::string& why) {
    const WebAnswer answer = take(request);
    EXPECT_EQ(answer.status, status) << answer.body;
    EXPECT_THAT(answer.body, HasSubstr(why));
    EXPECT_EQ(std::ranges::count(answer.body, '\n'), 1) << "one line";
    EXPECT_FALSE(desk_.next());
    EXPECT_FALSE(desk_.next_event());
  }
  Json last() const { return Json::parse(desk_.report().body); }

  const Studio studio_ = studio_of_two();
  std::string viewer_token_;
  CommandEndpoint desk_{studio_, kToken};
};

TEST_F(Desk, takes_an_order_and_tells_how_it_ended) {
  const WebAnswer answer = take(order(R"({"do":"arm", "take":"kendo-07"})"));
  EXPECT_EQ(answer.status, 202) << answer.body;
  const auto taken = desk_.next();
  ASSERT_TRUE(taken);
  EXPECT_EQ(taken->take, "kendo-07");
  EXPECT_FALSE(desk_.next()) << "once";
  EXPECT_EQ(last()["under_way"], true);
  EXPECT_EQ(last()["by"], "127.0.0.1");
  desk_.finish({.status = 1,
                .output = R"({"done": false, "lines": ["cap01  no disk", "refused: 0 of 1"]})",
                .errors = "refused: 0 of 1\n"});
  EXPECT_EQ(last()["under_way"], false);
  EXPECT_EQ(last()["status"], 1);
  EXPECT_EQ(last()["lines"], Json({"cap01  no disk", "refused: 0 of 1"}));
  EXPECT_EQ(last()["text"], "arm kendo-07");
}

TEST_F(Desk, tells_the_words_of_v3dctl_where_it_printed_no_json) {
  take(order(R"({"do":"start"})"));
  desk_.finish({.status = 2, .output = "", .errors = "v3dctl: no studio key\n\x1b[2J\n"});
  EXPECT_EQ(last()["lines"][0], "v3dctl: no studio key");
  EXPECT_EQ(last()["lines"].size(), 2);
  EXPECT_EQ(desk_.report().body.find('\x1b'), std::string::npos);
  take(order(R"({"do":"start"})"));
  desk_.finish({.status = 143, .timed_out = true, .output = "{", .errors = ""});
  EXPECT_THAT(last()["lines"][0].get<std::string>(), HasSubstr("did not end in time"));
}

TEST_F(Desk, names_in_the_events_who_ordered_what) {
  take(order(R"({"do":"look"})"));
  EXPECT_EQ(desk_.next_event()->text, "127.0.0.1 may command");
  EXPECT_FALSE(desk_.next()) << "to look is no order";
  take(order(R"({"do":"stop"})"));
  EXPECT_EQ(desk_.next_event()->text, "127.0.0.1: stop");
  desk_.finish(
      {.status = 3, .output = R"({"lines": ["take kendo-07: incomplete"]})", .errors = ""});
  const auto event = desk_.next_event();
  EXPECT_EQ(event->text, "127.0.0.1: stop: exit status 3: take kendo-07: incomplete");
  EXPECT_EQ(event->severity, Severity::kWarning);
}

TEST_F(Desk, has_one_order_under_way_at_a_time) {
  take(order(R"({"do":"arm", "take":"kendo-07"})"));
  desk_.next();
  desk_.next_event();
  expect_refused(order(R"({"do":"start"})"), 409, "arm kendo-07 of 127.0.0.1 is still under way");
  desk_.finish({});
  EXPECT_EQ(take(order(R"({"do":"start"})")).status, 202);
  EXPECT_EQ(last()["number"], 2);
}

TEST_F(Desk, takes_no_order_without_the_operators_token) {
  WebRequest request = order(R"({"do":"stop"})");
  request.operator_token = "";
  expect_refused(request, 401, "orders want the operators' token");
  request.operator_token = std::string(kToken) + "x";
  expect_refused(request, 401, "not the operators' token");
  expect_refused(request, 429, "try again in 1 s");
  request.operator_token = kToken;
  EXPECT_EQ(take(request).status, 202);
}

TEST_F(Desk, admits_the_right_token_however_many_wrong_ones_came_from_whatever_address) {
  WebRequest guess = order(R"({"do":"stop"})");
  guess.operator_token = std::string(kToken) + "x";
  for (int i = 0; i < 200; ++i) {
    guess.address = "10.0.7." + std::to_string(i);
    take(guess);
  }
  EXPECT_EQ(take(guess).status, 429) << "wrong tokens are throttled";
  WebRequest right = order(R"({"do":"look"})");
  right.address = "10.0.9.1";
  EXPECT_EQ(take(right).status, 200) << "an address that never erred";
  right.address = "10.0.7.1";
  EXPECT_EQ(take(right).status, 200) << "an address that sent a wrong token";
}

TEST_F(Desk, takes_no_order_for_the_token_of_those_who_look) {
  viewer_token_ = "viewers-0123456789";
  WebRequest request = order(R"({"do":"stop"})");
  expect_refused(request, 401, "shown to who has its token");
  request.authorization = "Bearer " + viewer_token_;
  request.operator_token = viewer_token_;
  expect_refused(request, 401, "not the operators' token");
  request.address = "127.0.0.2";  // has not tried yet
  request.target = "/api/order?token=" + std::string(kToken);
  request.operator_token = "";
  expect_refused(request, 401, "orders want the operators' token");
}

TEST_F(Desk, takes_no_order_of_another_page) {
  WebRequest request = order(R"({"do":"stop"})");
  request.origin = "http://evil.example";
  expect_refused(request, 403, "another page");
  request.origin = "null";
  expect_refused(request, 403, "another page");
  request = order(R"({"do":"stop"})");
  request.host = "evil.example";
  expect_refused(request, 403, "localhost");
}

TEST_F(Desk, takes_no_order_that_a_form_or_a_link_could_send) {
  WebRequest request = order(R"({"do":"stop"})");
  for (const char* type : {"", "text/plain", "application/x-www-form-urlencoded",
                           "multipart/form-data", "application/jsonx"}) {
    request.content_type = type;
    expect_refused(request, 415, "application/json");
  }
  request = order(R"({"do":"stop"})");
  for (const char* method : {"PUT", "OPTIONS", "DELETE", "post"}) {
    request.method = method;
    EXPECT_EQ(take(request).status, 405) << method;
  }
  request.method = "GET";
  EXPECT_EQ(take(request).status, 200) << "that looks";
  EXPECT_FALSE(desk_.next());
  request.method = "POST";
  request.target = "/api/takes";
  EXPECT_EQ(take(request).status, 405);
}

TEST_F(Desk, takes_no_order_that_is_too_large_or_none) {
  WebRequest request = order("");
  request.has_unread_body = true;
  expect_refused(request, 413, "shorter than that");
  expect_refused(order(""), 400, "expected an order as JSON");
  expect_refused(order(R"({"do":"arm", "take":"../../etc"})"), 400, "take: no name of a take");
}

TEST_F(Desk, takes_no_order_where_the_studio_file_allows_none) {
  CommandEndpoint closed(studio_, "");
  WebRequest request = order(R"({"do":"stop"})");
  for (const char* token : {"", kToken}) {
    request.operator_token = token;
    const WebAnswer answer = closed.take(request, Monotonic::now());
    EXPECT_EQ(answer.status, 403);
    EXPECT_THAT(answer.body, HasSubstr("[viewer] control"));
  }
  EXPECT_FALSE(closed.next());
}

TEST_F(Desk, shows_everybody_the_last_order_when_it_has_changed) {
  StudioStatus board(studio_, {}, "");
  board.set_order(desk_.last());
  const auto watcher = board.watch();
  EXPECT_FALSE(watcher->next()) << "there was none";
  take(order(R"({"do":"stop"})"));
  for (int turn = 0; turn < 3; ++turn) board.set_order(desk_.last());
  EXPECT_THAT(*watcher->next()->bytes, HasSubstr("\"under_way\":true"));
  EXPECT_FALSE(watcher->next());
  desk_.finish({});
  board.set_order(desk_.last());
  EXPECT_THAT(*watcher->next()->bytes, HasSubstr("\"under_way\":false"));
  EXPECT_THAT(*board.watch()->next()->bytes, HasSubstr("\"do\":\"stop\"")) << "who comes later too";
}

class OperatorToken : public testing::Test {
 protected:
  OperatorToken() {
    std::ofstream(folder_ / "operator.token") << kToken << "\n";
    chmod((folder_ / "operator.token").c_str(), 0640);
    studio_.viewer.operator_token = folder_ / "operator.token";
    studio_.viewer.control = true;
  }
  const test::TemporaryFolder folder_;
  Studio studio_;
};

TEST_F(OperatorToken, is_read_only_where_browsers_may_command) {
  EXPECT_EQ(load_operator_token(studio_, ""), kToken);
  studio_.viewer.control = false;
  studio_.viewer.operator_token = folder_ / "none";
  EXPECT_EQ(load_operator_token(studio_, ""), "");
  studio_.viewer.control = true;
  EXPECT_THROW(load_operator_token(studio_, ""), InputError);
}

TEST_F(OperatorToken, is_another_than_that_of_those_who_look) {
  EXPECT_THROW(load_operator_token(studio_, kToken), InputError);
}

ProgramEnd end_of(const std::vector<std::string>& words, Duration patience) {
  ChildProgram program(words, Monotonic::now() + patience);
  std::optional<ProgramEnd> end;
  EXPECT_TRUE(
      becomes_true([&] { return (end = program.poll(Monotonic::now())).has_value(); }, within(30)));
  return end.value_or(ProgramEnd{});
}

constexpr Duration kLong = std::chrono::seconds(30);

TEST(ChildProgram, is_told_of_with_its_status_and_all_that_it_printed) {
  const ProgramEnd end = end_of({"/bin/sh", "-c", "echo out; echo err >&2; exit 3"}, kLong);
  EXPECT_EQ(end.status, 3);
  EXPECT_EQ(end.output, "out\n");
  EXPECT_EQ(end.errors, "err\n");
  EXPECT_FALSE(end.timed_out);
}

TEST(ChildProgram, is_given_its_words_as_they_are) {
  EXPECT_EQ(end_of({"/bin/echo", "$(id)", "a b", ";ls"}, kLong).output, "$(id) a b ;ls\n");
}

TEST(ChildProgram, has_nothing_of_ours) {
  setenv("V3D_SECRET", "x", 1);
  EXPECT_EQ(end_of({"/usr/bin/env"}, kLong).output, "PATH=/usr/bin:/bin\nLC_ALL=C.UTF-8\n");
  const int left_open = dup2(0, 77);  // as a library may leave one
  ASSERT_EQ(left_open, 77);
  EXPECT_EQ(end_of({"/bin/sh", "-c", "test ! -e /proc/self/fd/77; echo $?"}, kLong).output, "0\n");
  close(left_open);
}

TEST(ChildProgram, is_ended_at_its_deadline) {
  const ProgramEnd end = end_of({"/bin/sleep", "1000"}, Duration::zero());
  EXPECT_EQ(end.status, 128 + SIGTERM);
  EXPECT_TRUE(end.timed_out);
}

TEST(ChildProgram, may_print_without_end) {
  const ProgramEnd end = end_of({"/usr/bin/head", "-c", "3000000", "/dev/zero"}, kLong);
  EXPECT_EQ(end.status, 0);
  EXPECT_EQ(end.output.size(), ChildProgram::kMaxOutput);
}

TEST(ChildProgram, that_is_not_there_ends_at_once) {
  const ProgramEnd end = end_of({"/nowhere/v3dctl"}, kLong);
  EXPECT_EQ(end.status, 127);
  EXPECT_THAT(end.errors, HasSubstr("cannot run /nowhere/v3dctl"));
}

}  // namespace
}  // namespace v3d
