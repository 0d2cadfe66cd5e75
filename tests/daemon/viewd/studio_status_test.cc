// What subscribers of the studio page receive, also the slow ones.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <string>

#include "base/core/time.h"
#include "daemon/viewd/web_streams.h"
#include "wire/messages.h"

namespace v3d::viewd {
namespace {

using testing::HasSubstr;

class StudioStatusTest : public testing::Test {
 protected:
  static Studio studio() {
    Studio studio;
    studio.name = "dojo";
    for (const char* camera : {"cam01", "cam02"}) {
      studio.cameras.emplace_back();
      studio.cameras.back().name = camera;
      studio.cameras.back().node = "cap01";
    }
    return studio;
  }
  static wire::HealthMessage health(const std::string& text) {
    wire::HealthMessage message;
    message.node = "cap01";
    message.text = text;
    return message;
  }
  static wire::PreviewMessage preview(const std::string& camera) {
    wire::PreviewMessage message;
    message.camera = camera;
    message.jpeg = {1, 2, 3};
    return message;
  }
  StudioStatus status_{studio(), {"cap01"}, ""};
  const MonotonicInstant now_ = Monotonic::now();
};

TEST_F(StudioStatusTest, sends_a_slow_subscriber_only_the_newest_state) {
  const auto subscriber = status_.subscribe();
  for (const char* text : {"first", "second", "third"}) {
    status_.on_health(health(text), now_);
    status_.refresh(now_);
  }
  EXPECT_THAT(*subscriber->next()->bytes, HasSubstr("third"));
  EXPECT_FALSE(subscriber->next());
  status_.refresh(now_);
  EXPECT_FALSE(subscriber->next()) << "nothing has changed";
}

TEST_F(StudioStatusTest, repeats_an_unchanged_state_so_that_a_page_notices_a_silent_network) {
  const auto subscriber = status_.subscribe();
  status_.refresh(now_);
  EXPECT_TRUE(subscriber->next());
  const Duration step = std::chrono::milliseconds(20);
  int states = 0;
  for (MonotonicInstant now = now_; now <= now_ + std::chrono::seconds(10); now += step) {
    status_.refresh(now);
    if (subscriber->next()) ++states;
  }
  EXPECT_EQ(states, 5) << "one every 2 s";
}

TEST_F(StudioStatusTest, sends_the_time_of_the_server_by_which_pages_date_their_orders) {
  const double before = static_cast<double>(to_ns(Realtime::now())) * 1e-6;
  status_.refresh(now_);
  const auto state = nlohmann::json::parse(*status_.subscribe()->next()->bytes);
  EXPECT_GE(state["sent_ms"].get<double>(), before);
}

TEST_F(StudioStatusTest, removes_a_silent_node) {
  status_.on_health(health("here"), now_);
  status_.refresh(now_);
  status_.refresh(now_ + StudioStatus::kSilenceTimeout + std::chrono::seconds(1));
  EXPECT_THAT(*status_.subscribe()->next()->bytes, HasSubstr("\"heard\":false"));
}

TEST_F(StudioStatusTest, keeps_the_last_events_and_the_last_preview_of_each_camera) {
  for (int i = 0; i < 500; ++i) {
    wire::EventMessage event;
    event.text = "event " + std::to_string(i) + ".";
    status_.on_event(event);
    status_.on_preview(preview("cam01"));
    status_.on_preview(preview("stranger"));
  }
  status_.refresh(now_);
  const auto subscriber = status_.subscribe();
  subscriber->next();  // the state
  EXPECT_THAT(*subscriber->next()->bytes, HasSubstr("event 400."));
  size_t messages = 1;
  while (const auto message = subscriber->next()) ++messages;
  EXPECT_EQ(messages, StudioStatus::kEventsKept + 1) << "and one preview, of the known camera";
}

TEST_F(StudioStatusTest, sends_a_slow_subscriber_previews_of_all_cameras_in_turn) {
  const auto subscriber = status_.subscribe();
  std::string sent;
  for (int i = 0; i < 4; ++i) {  // a message of the subscriber takes as long as both previews
    status_.on_preview(preview("cam01"));
    status_.on_preview(preview("cam02"));
    sent += *subscriber->next()->bytes;
  }
  EXPECT_THAT(sent, HasSubstr("cam01"));
  EXPECT_THAT(sent, HasSubstr("cam02"));
}

TEST_F(StudioStatusTest, sends_events_reports_and_previews_to_a_subscriber_slower_than_the_state) {
  const auto subscriber = status_.subscribe();
  wire::EventMessage event;
  event.text = "cam01 is silent";
  CommandReport report;
  report.number = 1;
  report.by = "tablet";
  std::string sent;
  for (int i = 0; i < 6; ++i) {
    status_.on_health(health("health " + std::to_string(i)), now_);
    status_.refresh(now_);
    if (i == 1) {
      status_.on_event(event);
      status_.on_preview(preview("cam01"));
      status_.set_report(report);
    }
    sent += *subscriber->next()->bytes;
  }
  EXPECT_THAT(sent, HasSubstr("health 0")) << "the first message is the state";
  EXPECT_THAT(sent, HasSubstr("cam01 is silent"));
  EXPECT_THAT(sent, HasSubstr("tablet"));
  EXPECT_THAT(sent, HasSubstr("\"preview\""));
  EXPECT_THAT(sent, HasSubstr("health 4")) << "the state follows, and takes turns with previews";
}

}  // namespace
}  // namespace v3d::viewd
