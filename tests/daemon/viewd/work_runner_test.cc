#include "daemon/web/work_runner.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <future>

#include "support/child_process.h"

namespace v3d::viewd {
namespace {

using namespace std::chrono_literals;
using test::becomes_true;
using test::within;
using testing::ElementsAre;
using testing::IsEmpty;

class WorkRunnerTest : public testing::Test {
 protected:
  ~WorkRunnerTest() override {
    if (!answers_) disk_.set_value();
    io_.stop();
  }
  /// Work that waits for the disk.
  std::function<web::WebResponse()> waiting_work() {
    return [this, disk = disk_answers_] {
      ++started_;
      disk.wait();
      return web::plain_response(200, "read");
    };
  }
  bool run(web::WorkRunner& runner, const std::string& name = "") {
    return runner.run(name, waiting_work(), [this](const web::WebResponse& response) {
      statuses_.push_back(response.status);
    });
  }
  void disk_answers() {
    answers_ = true;
    disk_.set_value();
  }
  /// Runs the thread of the server until there are so many responses.
  bool receives(size_t responses) {
    return becomes_true(
        [&] {
          io_.restart();
          io_.poll();
          return statuses_.size() >= responses;
        },
        within(60));
  }

  std::promise<void> disk_;
  std::shared_future<void> disk_answers_ = disk_.get_future().share();
  bool answers_ = false;
  std::atomic<int> started_ = 0;
  boost::asio::io_context io_{1};
  std::vector<int> statuses_;
};

TEST_F(WorkRunnerTest, runs_as_much_work_at_once_as_it_has_threads) {
  web::WorkRunner runner(io_, {.threads = 3, .timeout = 1h, .late = "late"});
  for (int i = 0; i < 5; ++i) EXPECT_TRUE(run(runner));
  EXPECT_TRUE(becomes_true([&] { return started_ == 3; }, within(60)));
  EXPECT_THAT(statuses_, IsEmpty());
  disk_answers();
  EXPECT_TRUE(receives(5));
  EXPECT_THAT(statuses_, ElementsAre(200, 200, 200, 200, 200));
}

TEST_F(WorkRunnerTest, rejects_work_beyond_its_limit_also_when_nobody_waits_for_the_rest_any_more) {
  web::WorkRunner runner(io_, {.threads = 1, .max_waiting = 2, .timeout = 10ms, .late = "late"});
  EXPECT_TRUE(run(runner));
  EXPECT_TRUE(run(runner));
  EXPECT_FALSE(run(runner));
  EXPECT_TRUE(receives(2));
  EXPECT_THAT(statuses_, ElementsAre(503, 503));
  EXPECT_FALSE(run(runner)) << "the disk still has the work of both";
  disk_answers();
  EXPECT_TRUE(becomes_true(
      [&] {
        io_.restart();
        io_.poll();
        return run(runner);
      },
      within(60)));
}

TEST_F(WorkRunnerTest, shares_a_run_between_requests_of_one_name) {
  web::WorkRunner runner(io_, {.threads = 2, .timeout = 1h, .late = "late"});
  for (int i = 0; i < 3; ++i) EXPECT_TRUE(run(runner, "takes"));
  disk_answers();
  EXPECT_TRUE(receives(3));
  EXPECT_EQ(started_, 1);
}

}  // namespace
}  // namespace v3d::viewd
