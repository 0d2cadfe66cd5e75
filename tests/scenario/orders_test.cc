// Scenario tests of orders by HTTP, as a browser sends them, to the real v3d-viewd.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "viewed_studio.h"

namespace v3d {
namespace {

using test::becomes_true;
using test::Connection;
using test::within;
using testing::HasSubstr;
using Json = nlohmann::json;

/// True when the writable memory of a process holds these bytes.
bool holds(pid_t pid, const std::string& bytes) {
  const std::string process = "/proc/" + std::to_string(pid);
  std::ifstream maps(process + "/maps");
  std::ifstream memory(process + "/mem", std::ios::binary);
  EXPECT_TRUE(maps.good() && memory.good());
  for (std::string line; std::getline(maps, line);) {
    uint64_t first = 0;
    uint64_t end = 0;
    char modes[5] = {};
    if (std::sscanf(line.c_str(), "%lx-%lx %4s", &first, &end, modes) != 3) continue;
    if (modes[0] != 'r' || modes[1] != 'w') continue;
    std::string part(end - first, 0);
    memory.clear();
    memory.seekg(static_cast<std::streamoff>(first));
    memory.read(part.data(), static_cast<std::streamsize>(part.size()));
    if (part.find(bytes) != std::string::npos) return true;
  }
  return false;
}

pid_t child_of(pid_t pid) {
  const std::string process = "/proc/" + std::to_string(pid) + "/task/" + std::to_string(pid);
  std::ifstream children(process + "/children");
  pid_t child = -1;
  children >> child;
  return child;
}

/// At 5 Hz, a busy machine records whole takes.
class CommandedStudio : public test::ViewedStudio {
 protected:
  CommandedStudio() : ViewedStudio(test::kAcceptsOrders, {.rate = "5"}) {}

  /// The bytes of the studio key.
  std::string studio_secret() const {
    const std::string text = read_file(studio_.network.key);
    const size_t line = text.find_last_of('\n', text.size() - 2) + 1;
    std::string secret;
    for (size_t at = line; at + 1 < text.size(); at += 2) {
      secret += static_cast<char>(std::stoi(text.substr(at, 2), nullptr, 16));
    }
    return secret;
  }
  /// The status of the last order; {} when there is no reply.
  Json last_order() const {
    const auto reply = get("/api/order");
    if (!reply->receives("\"under_way\"")) return {};
    return Json::parse(reply->text().substr(reply->text().find("\r\n\r\n")), nullptr, false);
  }
  /// Posts an order, waits up to 90 s until it has ended, and returns its status.
  Json execute(const std::string& order) {
    const auto accepted = post(order, test::kOperatorToken);
    EXPECT_TRUE(accepted->receives("202 Accepted")) << accepted->text();
    Json status;
    EXPECT_TRUE(becomes_true(
        [&] {
          status = last_order();
          return status.value("under_way", true) == false;
        },
        within(90)))
        << status << viewd_->output();
    return status;
  }
};

TEST_F(CommandedStudio, records_a_complete_take_by_orders_from_a_browser) {
  const auto watcher = watch("/api/studio");
  const Json armed = execute(R"({"do": "arm", "take": "kendo-07"})");
  EXPECT_EQ(armed["status"], 0) << armed;
  EXPECT_THAT(armed["lines"].back().get<std::string>(), HasSubstr("armed kendo-07: trigger cap01"));
  const Json started = execute(R"({"do": "start"})");
  EXPECT_EQ(started["status"], 0) << started;
  EXPECT_TRUE(reaches("cap01", "frames_written", 4 * 10)) << log();
  const Json stopped = execute(R"({"do": "stop"})");
  EXPECT_EQ(stopped["status"], 0) << stopped;
  EXPECT_THAT(stopped["lines"].back().get<std::string>(), HasSubstr("take kendo-07: complete"));
  test::ChildProcess verify({bin("v3dctl"), "verify", take().folder}, folder_ / "verify.log");
  EXPECT_EQ(verify.wait(within(60)), 0) << verify.output();
  EXPECT_TRUE(watcher->receives("127.0.0.1: stop: done: take kendo-07: complete"))
      << "an event reports it";
  EXPECT_THAT(viewd_->output(), HasSubstr("operator at 127.0.0.1: arm kendo-07"));
  const std::string secret = studio_secret();
  ASSERT_EQ(secret.size(), 32U);
  EXPECT_FALSE(holds(viewd_->pid(), secret)) << "the process that parses the requests of browsers";
  EXPECT_TRUE(holds(child_of(viewd_->pid()), secret))
      << "the process that receives the messages of the studio";
}

TEST_F(CommandedStudio, ends_a_take_after_the_seconds_of_the_order) {
  execute(R"({"do": "arm", "take": "kendo-07", "seconds": 2})");
  EXPECT_EQ(execute(R"({"do": "start"})")["status"], 0);
  ASSERT_TRUE(becomes_idle()) << log();
  const Json stopped = execute(R"({"do": "stop"})");
  EXPECT_THAT(stopped["lines"].back().get<std::string>(), HasSubstr("x 10 pulses")) << stopped;
}

TEST_F(CommandedStudio, returns_the_message_of_v3dctl_when_the_studio_rejects_an_order) {
  const Json refused = execute(R"({"do": "start"})");
  EXPECT_EQ(refused["status"], 1) << refused;
  EXPECT_THAT(refused["lines"].dump(), HasSubstr("refused: ")) << refused;
}

TEST_F(CommandedStudio, rejects_orders_without_the_operators_token) {
  EXPECT_TRUE(post(R"({"do": "arm", "take": "kendo-07"})", "")->receives("401 Unauthorized"));
  EXPECT_TRUE(post(R"({"do": "start"})", "operators-012345678X")->receives("401 Unauthorized"));
  // At most one guess a second is answered; a slow machine may let a second pass between two.
  EXPECT_TRUE(becomes_true(
      [&] {
        const auto reply = post(R"({"do": "start"})", "operators-012345678X");
        return reply->receives("HTTP/1.1 4") &&
               reply->text().find("429 Too Many Requests") != std::string::npos;
      },
      within(60)));
  Connection large(port_, "/api/order",
                   "Content-Type: application/json\r\nX-V3D-Operator: operators-0123456789"
                   "\r\nContent-Length: 1000000000\r\n",
                   "POST", "{");
  EXPECT_TRUE(large.receives("413 Payload Too Large")) << large.text();
  Connection chunked(port_, "/api/order",
                     "Content-Type: application/json\r\nX-V3D-Operator: operators-0123456789"
                     "\r\nTransfer-Encoding: chunked\r\n",
                     "POST", "5\r\n{\"do\"\r\n");
  EXPECT_TRUE(chunked.receives("413 Payload Too Large")) << chunked.text();
  EXPECT_EQ(last_order()["number"], 0) << "no order was executed";
  EXPECT_TRUE(post(R"({"do": "start"})", test::kOperatorToken)->receives("202 Accepted"))
      << "the right token always passes";
  EXPECT_TRUE(viewd_->runs());
}

class WatchedStudio : public test::ViewedStudio {};

TEST_F(WatchedStudio, rejects_orders_unless_the_studio_file_enables_them) {
  Connection order(port_, "/api/order",
                   "Content-Type: application/json\r\nX-V3D-Operator: operators-0123456789"
                   "\r\nContent-Length: 15\r\n",
                   "POST", R"({"do": "start"})");
  EXPECT_TRUE(order.receives("403 Forbidden")) << order.text();
  EXPECT_TRUE(order.receives("[viewer] control"));
}

}  // namespace
}  // namespace v3d
