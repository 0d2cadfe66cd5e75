// Commands of the studio page: authorisation, parsing, and the call of v3dctl.
#include "daemon/viewd/command_endpoint.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <sys/stat.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "base/core/error.h"
#include "base/core/text.h"
#include "base/io/child_process.h"
#include "daemon/viewd/served_files.h"
#include "daemon/viewd/web_site.h"
#include "daemon/viewd/web_streams.h"
#include "support/child_process.h"
#include "support/temporary_folder.h"

namespace v3d::viewd {
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

class CommandParser : public testing::Test {
 protected:
  OperatorCommand read(const std::string& json) {
    const ParsedCommand read = parse_command(json, studio_);
    EXPECT_TRUE(read.command) << json << ": " << read.error;
    return read.command.value_or(OperatorCommand{});
  }
  std::string wrong(const std::string& json) {
    const ParsedCommand read = parse_command(json, studio_);
    EXPECT_FALSE(read.command) << json;
    return read.error;
  }
  const Studio studio_ = studio_of_two();
};

TEST_F(CommandParser, calls_v3dctl_with_fixed_words_and_valid_names) {
  EXPECT_THAT(read(R"({"do": "start"})").arguments(),
              ElementsAre("start", "--json", "--timeout", "10"));
  EXPECT_THAT(read(R"({"do": "stop"})").arguments(),
              ElementsAre("stop", "--json", "--timeout", "60"));
  EXPECT_THAT(read(R"({"do": "abort"})").arguments(),
              ElementsAre("abort", "--json", "--timeout", "10"));
  EXPECT_THAT(read(R"({"do": "arm", "take": "kendo-07"})").arguments(),
              ElementsAre("arm", "--json", "--timeout", "30", "kendo-07"));
  EXPECT_THAT(read(R"({"do":"arm", "take":"kendo-07", "seconds":60, "without":["cam02", "cam01"]})")
                  .arguments(),
              ElementsAre("arm", "--json", "--timeout", "30", "--pulses", "1500", "--allow-missing",
                          "cam02,cam01", "kendo-07"));
}

TEST_F(CommandParser, converts_seconds_to_pulses_by_the_rate_of_the_studio) {
  EXPECT_EQ(read(R"({"do":"arm", "take":"a", "seconds":0.5})").pulses, 13);
  EXPECT_EQ(read(R"({"do":"arm", "take":"a", "seconds":0.001})").pulses, 1);
  for (const char* seconds : {"0", "-1", "86401", "1e300", "\"60\"", "null", "[1]", "true"}) {
    EXPECT_THAT(wrong(R"({"do":"arm", "take":"a", "seconds":)" + std::string(seconds) + "}"),
                HasSubstr("seconds: expected"));
  }
}

TEST_F(CommandParser, reads_when_a_command_was_given) {
  EXPECT_FALSE(read(R"({"do":"stop"})").given);
  EXPECT_EQ(to_ns(*read(R"({"do":"stop", "at_ms":1700000000123.0})").given),
            1'700'000'000'123'000'000);
  for (const char* time : {"-1", "1e300", "\"now\"", "null", "[1]", "true"}) {
    EXPECT_THAT(wrong(R"({"do":"stop", "at_ms":)" + std::string(time) + "}"),
                HasSubstr("at_ms: expected"));
  }
}

TEST_F(CommandParser, accepts_only_valid_take_names) {
  for (const char* name :
       {"../x", "a/b", "", "-x", "--wait", ".x", "a b", "a;b", "$(a)", "a\\nb"}) {
    EXPECT_THAT(wrong(R"({"do":"arm", "take":")" + std::string(name) + "\"}"),
                HasSubstr("take: not a valid name of a take"))
        << name;
  }
  for (const char* name : {"check", "background"}) {
    EXPECT_THAT(wrong(R"({"do":"arm", "take":")" + std::string(name) + "\"}"),
                HasSubstr("the name is reserved for v3dctl " + std::string(name)));
  }
  EXPECT_THAT(wrong(R"({"do":"arm"})"), HasSubstr("take: missing"));
  EXPECT_THAT(wrong(R"({"do":"arm", "take": 7})"), HasSubstr("take: not a valid name"));
}

TEST_F(CommandParser, accepts_only_cameras_of_the_studio) {
  for (const char* cameras : {"[\"cam03\"]", "[\"--json\"]", "\"cam01\"", "[1]", "{}"}) {
    EXPECT_THAT(wrong(R"({"do":"arm", "take":"a", "without":)" + std::string(cameras) + "}"),
                HasSubstr("without: expected"));
  }
}

TEST_F(CommandParser, rejects_other_json) {
  for (const char* odd : {"", "stop", "[]", "null", "{", "{}", R"({"do":"background"})",
                          R"({"do":["stop"]})", R"({"do":"STOP"})"}) {
    EXPECT_FALSE(wrong(odd).empty()) << odd;
  }
  EXPECT_THAT(wrong(R"({"do":"stop", "take":"a"})"), HasSubstr("take: not known to \"stop\""));
  EXPECT_THAT(wrong(R"({"do":"arm", "take":"a", "studio":"b"})"), HasSubstr("studio: not known"));
  EXPECT_FALSE(wrong(std::string(4000, '[')).empty()) << "for any depth";
}

RC_GTEST_PROP(CommandText, accepts_a_take_exactly_when_its_name_is_valid,
              (const std::string& take)) {
  const std::string json =
      Json{{"do", "arm"}, {"take", take}}.dump(-1, ' ', false, Json::error_handler_t::replace);
  const ParsedCommand read = parse_command(json, studio_of_two());
  RC_ASSERT(read.command.has_value() == is_file_name(take));
}

TEST(TokenThrottle, doubles_the_delay_by_address) {
  TokenThrottle throttle;
  MonotonicInstant now = Monotonic::now();
  EXPECT_EQ(throttle.delay_for("a", now), Duration::zero());
  for (const int seconds : {1, 2, 4, 8, 16, 32, 60, 60}) {
    throttle.record_wrong("a", now);
    EXPECT_EQ(throttle.delay_for("a", now), std::chrono::seconds(seconds));
    EXPECT_EQ(throttle.delay_for("b", now), Duration::zero()) << "another address has no delay";
    now += std::chrono::seconds(seconds);
    EXPECT_EQ(throttle.delay_for("a", now), Duration::zero());
  }
  throttle.record_right("a");
  throttle.record_wrong("a", now);
  EXPECT_EQ(throttle.delay_for("a", now), TokenThrottle::kFirstDelay);
}

TEST(TokenThrottle, counts_further_addresses_as_one) {
  TokenThrottle throttle;
  const MonotonicInstant now = Monotonic::now();
  for (int i = 0; i < 1000; ++i) throttle.record_wrong(std::to_string(i), now);
  EXPECT_EQ(throttle.delay_for("stranger", now), TokenThrottle::kMaxDelay);
  EXPECT_EQ(throttle.delay_for("0", now), TokenThrottle::kFirstDelay);
  const MonotonicInstant later = now + TokenThrottle::kEntryLifetime + std::chrono::seconds(1);
  throttle.record_wrong("somebody", later);
  EXPECT_EQ(throttle.delay_for("0", later), Duration::zero()) << "forgotten";
}

class CommandEndpointTest : public testing::Test {
 protected:
  static web::WebRequest order(const std::string& body) {
    return {.method = "POST",
            .target = "/api/order",
            .host = "127.0.0.1:8330",
            .origin = "http://127.0.0.1:8330",
            .content_type = "application/json",
            .operator_token = kToken,
            .address = "127.0.0.1",
            .body = body};
  }
  web::WebResponse post(const web::WebRequest& request) {
    WebSite site(studio_, web::WebAccess(viewer_token_), {}, commands_);
    return site.respond(request);
  }
  /// Expects a refusal, and that nothing is executed.
  void expect_refused(const web::WebRequest& request, int status, const std::string& why) {
    const web::WebResponse response = post(request);
    EXPECT_EQ(response.status, status) << response.body;
    EXPECT_THAT(response.body, HasSubstr(why));
    EXPECT_EQ(std::ranges::count(response.body, '\n'), 1) << "one line";
    EXPECT_FALSE(commands_.next_command());
    EXPECT_FALSE(commands_.next_event());
  }
  Json last() const { return Json::parse(commands_.report().body); }

  const Studio studio_ = studio_of_two();
  std::string viewer_token_;
  CommandEndpoint commands_{studio_, kToken};
};

TEST_F(CommandEndpointTest, accepts_a_command_and_reports_its_result) {
  const web::WebResponse response = post(order(R"({"do":"arm", "take":"kendo-07"})"));
  EXPECT_EQ(response.status, 202) << response.body;
  const auto taken = commands_.next_command();
  ASSERT_TRUE(taken);
  EXPECT_EQ(taken->take, "kendo-07");
  EXPECT_FALSE(commands_.next_command()) << "once";
  EXPECT_EQ(last()["under_way"], true);
  EXPECT_EQ(last()["by"], "127.0.0.1");
  commands_.on_finished(
      {.status = 1,
       .output = R"({"done": false, "lines": ["cap01  no disk", "refused: 0 of 1"]})",
       .errors = "refused: 0 of 1\n"});
  EXPECT_EQ(last()["under_way"], false);
  EXPECT_EQ(last()["status"], 1);
  EXPECT_EQ(last()["lines"], Json({"cap01  no disk", "refused: 0 of 1"}));
  EXPECT_EQ(last()["text"], "arm kendo-07");
}

TEST_F(CommandEndpointTest, reports_the_error_output_of_v3dctl_without_json) {
  post(order(R"({"do":"start"})"));
  commands_.on_finished({.status = 2, .output = "", .errors = "v3dctl: no studio key\n\x1b[2J\n"});
  EXPECT_EQ(last()["lines"][0], "v3dctl: no studio key");
  EXPECT_EQ(last()["lines"].size(), 2);
  EXPECT_EQ(commands_.report().body.find('\x1b'), std::string::npos);
  post(order(R"({"do":"start"})"));
  commands_.on_finished({.status = 143, .timed_out = true, .output = "{", .errors = ""});
  EXPECT_THAT(last()["lines"][0].get<std::string>(), HasSubstr("did not end in time"));
}

TEST_F(CommandEndpointTest, reports_sender_and_command_in_events) {
  for (const char* check : {R"({"do":"check_token"})", R"({"do":"look"})"}) {
    post(order(check));
    EXPECT_EQ(commands_.next_event()->text, "127.0.0.1 has the operators' token");
    EXPECT_FALSE(commands_.next_command()) << check << " executes nothing";
  }
  post(order(R"({"do":"stop"})"));
  EXPECT_EQ(commands_.next_event()->text, "127.0.0.1: stop");
  commands_.on_finished(
      {.status = 3, .output = R"({"lines": ["take kendo-07: incomplete"]})", .errors = ""});
  const auto event = commands_.next_event();
  EXPECT_EQ(event->text, "127.0.0.1: stop: exit status 3: take kendo-07: incomplete");
  EXPECT_EQ(event->severity, wire::Severity::kWarning);
}

TEST_F(CommandEndpointTest, runs_one_command_at_a_time) {
  post(order(R"({"do":"arm", "take":"kendo-07"})"));
  commands_.next_command();
  commands_.next_event();
  expect_refused(order(R"({"do":"start"})"), 409, "arm kendo-07 of 127.0.0.1 is still running");
  commands_.on_finished({});
  EXPECT_EQ(post(order(R"({"do":"start"})")).status, 202);
  EXPECT_EQ(last()["number"], 2);
}

TEST_F(CommandEndpointTest,
       refuses_a_command_that_the_network_delivers_after_more_than_ten_seconds) {
  const auto given = [](std::chrono::seconds ago) {
    const auto ms = to_ns(Realtime::now() - ago) / 1'000'000;
    return order(R"({"do":"start", "at_ms":)" + std::to_string(ms) + "}");
  };
  expect_refused(given(std::chrono::seconds(95)), 409, "is 95 s old and was not executed");
  EXPECT_EQ(post(given(std::chrono::seconds(1))).status, 202);
  EXPECT_EQ(commands_.next_command()->verb, Verb::kStart);
  commands_.on_finished({});
  EXPECT_EQ(post(given(std::chrono::seconds(-60))).status, 202) << "its clock is ahead";
}

TEST_F(CommandEndpointTest, refuses_commands_without_the_operators_token) {
  web::WebRequest request = order(R"({"do":"stop"})");
  request.operator_token = "";
  expect_refused(request, 401, "orders require the operators' token");
  request.operator_token = std::string(kToken) + "x";
  expect_refused(request, 401, "not the operators' token");
  expect_refused(request, 429, "try again in 1 s");
  request.operator_token = kToken;
  EXPECT_EQ(post(request).status, 202);
}

TEST_F(CommandEndpointTest, admits_the_right_token_after_wrong_ones_of_any_address) {
  web::WebRequest guess = order(R"({"do":"stop"})");
  guess.operator_token = std::string(kToken) + "x";
  for (int i = 0; i < 200; ++i) {
    guess.address = "10.0.7." + std::to_string(i);
    post(guess);
  }
  EXPECT_EQ(post(guess).status, 429) << "wrong tokens are throttled";
  web::WebRequest right = order(R"({"do":"check_token"})");
  right.address = "10.0.9.1";
  EXPECT_EQ(post(right).status, 200) << "an address without wrong tokens";
  right.address = "10.0.7.1";
  EXPECT_EQ(post(right).status, 200) << "an address that sent a wrong token";
}

TEST_F(CommandEndpointTest, refuses_commands_with_the_viewers_token) {
  viewer_token_ = "viewers-0123456789";
  web::WebRequest request = order(R"({"do":"stop"})");
  expect_refused(request, 401, "requires a token");
  request.authorization = "Bearer " + viewer_token_;
  request.operator_token = viewer_token_;
  expect_refused(request, 401, "not the operators' token");
  request.address = "127.0.0.2";  // without wrong tokens
  request.target = "/api/order?token=" + std::string(kToken);
  request.operator_token = "";
  expect_refused(request, 401, "orders require the operators' token");
}

TEST_F(CommandEndpointTest, refuses_commands_of_pages_of_other_origins) {
  web::WebRequest request = order(R"({"do":"stop"})");
  request.origin = "http://evil.example";
  expect_refused(request, 403, "pages of other origins");
  request.origin = "null";
  expect_refused(request, 403, "pages of other origins");
  request = order(R"({"do":"stop"})");
  request.host = "evil.example";
  expect_refused(request, 403, "localhost");
}

TEST_F(CommandEndpointTest, refuses_commands_that_a_form_or_a_link_could_send) {
  web::WebRequest request = order(R"({"do":"stop"})");
  for (const char* type : {"", "text/plain", "application/x-www-form-urlencoded",
                           "multipart/form-data", "application/jsonx"}) {
    request.content_type = type;
    expect_refused(request, 415, "application/json");
  }
  request = order(R"({"do":"stop"})");
  for (const char* method : {"PUT", "OPTIONS", "DELETE", "post"}) {
    request.method = method;
    EXPECT_EQ(post(request).status, 405) << method;
  }
  request.method = "GET";
  EXPECT_EQ(post(request).status, 200) << "a viewer";
  EXPECT_FALSE(commands_.next_command());
  request.method = "POST";
  request.target = "/api/takes";
  EXPECT_EQ(post(request).status, 405);
}

TEST_F(CommandEndpointTest, refuses_bodies_that_are_too_large_or_invalid) {
  web::WebRequest request = order("");
  request.has_unread_body = true;
  expect_refused(request, 413, "at most 4096 bytes");
  expect_refused(order(""), 400, "expected an order as JSON");
  expect_refused(order(R"({"do":"arm", "take":"../../etc"})"), 400,
                 "take: not a valid name of a take");
}

TEST_F(CommandEndpointTest, refuses_commands_without_viewer_control) {
  CommandEndpoint closed(studio_, "");
  web::WebRequest request = order(R"({"do":"stop"})");
  for (const char* token : {"", kToken}) {
    request.operator_token = token;
    const web::WebResponse response = closed.post(request, Monotonic::now());
    EXPECT_EQ(response.status, 403);
    EXPECT_THAT(response.body, HasSubstr("[viewer] control"));
  }
  EXPECT_FALSE(closed.next_command());
}

TEST_F(CommandEndpointTest, sends_the_last_command_to_all_subscribers_when_it_changes) {
  StudioStatus status(studio_, {}, "");
  status.set_report(commands_.last_report());
  const auto subscriber = status.subscribe();
  EXPECT_FALSE(subscriber->next()) << "no command yet";
  post(order(R"({"do":"stop"})"));
  for (int turn = 0; turn < 3; ++turn) status.set_report(commands_.last_report());
  EXPECT_THAT(*subscriber->next()->bytes, HasSubstr("\"under_way\":true"));
  EXPECT_FALSE(subscriber->next());
  commands_.on_finished({});
  status.set_report(commands_.last_report());
  EXPECT_THAT(*subscriber->next()->bytes, HasSubstr("\"under_way\":false"));
  EXPECT_THAT(*status.subscribe()->next()->bytes, HasSubstr("\"do\":\"stop\""))
      << "also to late subscribers";
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

TEST_F(OperatorToken, is_read_only_with_viewer_control) {
  EXPECT_EQ(load_operator_token(studio_, ""), kToken);
  studio_.viewer.control = false;
  studio_.viewer.operator_token = folder_ / "none";
  EXPECT_EQ(load_operator_token(studio_, ""), "");
  studio_.viewer.control = true;
  EXPECT_THROW(load_operator_token(studio_, ""), InputError);
}

TEST_F(OperatorToken, must_differ_from_the_viewers_token) {
  EXPECT_THROW(load_operator_token(studio_, kToken), InputError);
}

ProgramEnd end_of(const std::vector<std::string>& words, Duration patience) {
  const MonotonicInstant start = Monotonic::now();
  ChildProgram program(words, start + patience);
  // A program is terminated at its deadline, and killed some time after. The first poll is for the
  // time of the start, so that a busy host does not kill it at once.
  std::optional<ProgramEnd> end = program.poll(start);
  EXPECT_TRUE(
      becomes_true([&] { return (end = program.poll(Monotonic::now())).has_value(); }, within(30)));
  return end.value_or(ProgramEnd{});
}

constexpr Duration kLong = std::chrono::seconds(30);

TEST(ChildProgram, returns_its_status_and_output) {
  const ProgramEnd end = end_of({"/bin/sh", "-c", "echo out; echo err >&2; exit 3"}, kLong);
  EXPECT_EQ(end.status, 3);
  EXPECT_EQ(end.output, "out\n");
  EXPECT_EQ(end.errors, "err\n");
  EXPECT_FALSE(end.timed_out);
}

TEST(ChildProgram, gets_its_arguments_unchanged) {
  EXPECT_EQ(end_of({"/bin/echo", "$(id)", "a b", ";ls"}, kLong).output, "$(id) a b ;ls\n");
}

TEST(ChildProgram, inherits_no_files_and_no_environment) {
  setenv("V3D_SECRET", "x", 1);
  EXPECT_EQ(end_of({"/usr/bin/env"}, kLong).output, "PATH=/usr/bin:/bin\nLC_ALL=C.UTF-8\n");
  const int left_open = dup2(0, 77);  // as a library may release one
  ASSERT_EQ(left_open, 77);
  EXPECT_EQ(end_of({"/bin/sh", "-c", "test ! -e /proc/self/fd/77; echo $?"}, kLong).output, "0\n");
  close(left_open);
}

TEST(ChildProgram, is_terminated_at_its_deadline) {
  const ProgramEnd end = end_of({"/bin/sleep", "1000"}, Duration::zero());
  EXPECT_EQ(end.status, 128 + SIGTERM);
  EXPECT_TRUE(end.timed_out);
}

TEST(ChildProgram, keeps_a_bounded_part_of_endless_output) {
  const ProgramEnd end = end_of({"/usr/bin/head", "-c", "3000000", "/dev/zero"}, kLong);
  EXPECT_EQ(end.status, 0);
  EXPECT_EQ(end.output.size(), ChildProgram::kMaxOutput);
}

TEST(ChildProgram, fails_at_once_if_the_program_is_missing) {
  const ProgramEnd end = end_of({"/nowhere/v3dctl"}, kLong);
  EXPECT_EQ(end.status, 127);
  EXPECT_THAT(end.errors, HasSubstr("cannot run /nowhere/v3dctl"));
}

}  // namespace
}  // namespace v3d::viewd
