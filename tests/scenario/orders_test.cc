// A take that an operator takes from a browser: orders by HTTP to the real v3d-viewd.
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

/// Whether a process has these bytes anywhere in what it may write.
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

class CommandedStudio : public test::ViewedStudio {
 protected:
  CommandedStudio() : ViewedStudio("control = true\noperator_token = \"operator.token\"\n") {}

  std::unique_ptr<Connection> post(const std::string& order, const std::string& token) const {
    return std::make_unique<Connection>(
        port_, "/api/order",
        "Connection: close\r\nContent-Type: application/json\r\nX-V3D-Operator: " + token +
            "\r\nContent-Length: " + std::to_string(order.size()) + "\r\n",
        "POST", order);
  }
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
  /// What there is to tell of the last order.
  Json last() const {
    const auto told = get("/api/order");
    if (!told->hears("\"under_way\"")) return {};
    return Json::parse(told->text().substr(told->text().find("\r\n\r\n")), nullptr, false);
  }
  /// The report of an order, once it has ended.
  Json carried_out(const std::string& order) {
    const auto taken = post(order, test::kOperatorToken);
    EXPECT_TRUE(taken->hears("202 Accepted")) << taken->text();
    Json told;
    EXPECT_TRUE(becomes_true(
        [&] {
          told = last();
          return told.value("under_way", true) == false;
        },
        within(90)))
        << told << viewd_->output();
    return told;
  }
};

TEST_F(CommandedStudio, records_a_complete_take_by_orders_from_a_browser) {
  const auto watcher = watch("/api/studio");
  const Json armed = carried_out(R"({"do": "arm", "take": "kendo-07"})");
  EXPECT_EQ(armed["status"], 0) << armed;
  EXPECT_THAT(armed["lines"].back().get<std::string>(), HasSubstr("armed kendo-07: trigger cap01"));
  const Json started = carried_out(R"({"do": "start"})");
  EXPECT_EQ(started["status"], 0) << started;
  EXPECT_TRUE(reaches("cap01", "frames_written", 4 * 20)) << log();
  const Json stopped = carried_out(R"({"do": "stop"})");
  EXPECT_EQ(stopped["status"], 0) << stopped;
  EXPECT_THAT(stopped["lines"].back().get<std::string>(), HasSubstr("take kendo-07: complete"));
  test::ChildProcess verify({bin("v3dctl"), "verify", take().folder}, folder_ / "verify.log");
  EXPECT_EQ(verify.wait(within(60)), 0) << verify.output();
  EXPECT_TRUE(watcher->hears("127.0.0.1: stop: done: take kendo-07: complete")) << "an event tells";
  EXPECT_THAT(viewd_->output(), HasSubstr("operator at 127.0.0.1: arm kendo-07"));
  const std::string secret = studio_secret();
  ASSERT_EQ(secret.size(), 32U);
  EXPECT_FALSE(holds(viewd_->pid(), secret)) << "the process that reads what browsers send";
  EXPECT_TRUE(holds(child_of(viewd_->pid()), secret)) << "the one that hears the studio";
}

TEST_F(CommandedStudio, ends_a_take_after_the_seconds_of_the_order) {
  carried_out(R"({"do": "arm", "take": "kendo-07", "seconds": 1.5})");
  EXPECT_EQ(carried_out(R"({"do": "start"})")["status"], 0);
  ASSERT_TRUE(becomes_idle()) << log();
  const Json stopped = carried_out(R"({"do": "stop"})");
  EXPECT_THAT(stopped["lines"].back().get<std::string>(), HasSubstr("x 30 pulses")) << stopped;
}

TEST_F(CommandedStudio, returns_the_message_of_v3dctl_when_the_studio_rejects_an_order) {
  const Json refused = carried_out(R"({"do": "start"})");
  EXPECT_EQ(refused["status"], 1) << refused;
  EXPECT_THAT(refused["lines"].dump(), HasSubstr("refused: ")) << refused;
}

TEST_F(CommandedStudio, rejects_orders_without_the_operators_token) {
  EXPECT_TRUE(post(R"({"do": "arm", "take": "kendo-07"})", "")->hears("401 Unauthorized"));
  EXPECT_TRUE(post(R"({"do": "start"})", "operators-012345678X")->hears("401 Unauthorized"));
  EXPECT_TRUE(post(R"({"do": "start"})", "operators-012345678X")->hears("429 Too Many Requests"));
  Connection large(port_, "/api/order",
                   "Content-Type: application/json\r\nX-V3D-Operator: operators-0123456789"
                   "\r\nContent-Length: 1000000000\r\n",
                   "POST", "{");
  EXPECT_TRUE(large.hears("413 Payload Too Large")) << large.text();
  Connection chunked(port_, "/api/order",
                     "Content-Type: application/json\r\nX-V3D-Operator: operators-0123456789"
                     "\r\nTransfer-Encoding: chunked\r\n",
                     "POST", "5\r\n{\"do\"\r\n");
  EXPECT_TRUE(chunked.hears("413 Payload Too Large")) << chunked.text();
  EXPECT_EQ(last()["number"], 0) << "nothing was carried out";
  EXPECT_TRUE(post(R"({"do": "start"})", test::kOperatorToken)->hears("202 Accepted"))
      << "the right token always passes";
  EXPECT_TRUE(viewd_->runs());
}

class WatchedStudio : public test::ViewedStudio {};

TEST_F(WatchedStudio, rejects_orders_unless_the_studio_file_enables_them) {
  Connection order(port_, "/api/order",
                   "Content-Type: application/json\r\nX-V3D-Operator: operators-0123456789"
                   "\r\nContent-Length: 15\r\n",
                   "POST", R"({"do": "start"})");
  EXPECT_TRUE(order.hears("403 Forbidden")) << order.text();
  EXPECT_TRUE(order.hears("[viewer] control"));
}

}  // namespace
}  // namespace v3d
