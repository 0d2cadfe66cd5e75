#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>

#include "base/core/text.h"
#include "daemon/bus/channel_list.h"
#include "daemon/bus/datagram_sender.h"
#include "daemon/bus/message_receiver.h"
#include "daemon/node/node_health.h"
#include "wire/codec.h"

namespace v3d::node {
namespace {

using testing::EndsWith;
using testing::HasSubstr;
using testing::Not;

/// Names of the values that v3d-captured sends for each camera.
constexpr const char* kValues[] = {
    "frames",         "frames_suspect",      "frames_dropped", "frames_damaged",   "underruns",
    "packets_resent", "packets_missing",     "losses",         "settings_ignored", "phase_us",
    "ptp_offset_us",  "temperature_celsius", "exposure_us",    "frames_missing",   "streaming_flag",
    "queue_frames",   "frames_per_second"};

/// Health of cap01 with all values and texts of `cameras`, each of which is in fault.
wire::HealthMessage health_of(int cameras, size_t name_size) {
  wire::HealthMessage health;
  health.node = "cap01";
  health.program = "v3d-captured";
  health.version = "1.4.0+2026-11-29";
  std::vector<std::string> problems;
  for (int i = 0; i < cameras; ++i) {
    std::string camera = "cam" + std::to_string(1000 + i);
    camera.resize(name_size, 'x');
    for (const char* value : kValues) health.values[camera + "." + value] = 1;
    health.texts[camera + ".model"] = "Blackfly S BFS-PGE-16S2C with a lens";
    health.texts[camera + ".firmware"] = "1707.1.8.0, of 2021-03-04";
    problems.push_back(camera + ": no answer from the camera at 192.168.123.231 within 3 s; " +
                       "try again after the link of the switch is up");
  }
  for (int i = 0; i < 80; ++i) health.values["value_of_the_node_" + std::to_string(i)] = i;
  health.text = join_camera_problems(problems);
  return health;
}

class Receiver {
 public:
  Receiver() {
    authenticator_.set_key(key_);
    authenticator_.members().require();
    authenticator_.members().set_members(std::make_shared<const wire::MemberList>(
        wire::MemberList{.studio = "kyoto",
                         .serial = 1,
                         .members = {{"cap01", wire::Role::kCapture, cap01_.public_key()}}}));
  }
  /// The decoded message of cap01, which responds to the challenge of the receiver.
  std::optional<wire::HealthMessage> receive(const wire::HealthMessage& health) {
    send(wire::health_channel("cap01"), encode(health));
    if (!challenge_) return std::nullopt;
    wire::SessionMessage response = *challenge_;
    response.newest = sender_.sequence - 1;
    response.is_answer = true;
    send(wire::kSessionChannel, encode(response));
    return send(wire::health_channel("cap01"), encode(health));
  }

 private:
  std::optional<wire::HealthMessage> send(const std::string& channel, const wire::Bytes& message) {
    std::optional<wire::HealthMessage> got;
    for (const auto& datagram : sender_.signed_datagrams(channel, message, cap01_)) {
      const auto in = receiver_.receive(datagram, 1, test::kReceiverNow);
      if (in && in->is_accepted) got = wire::decode<wire::HealthMessage>(in->bytes);
    }
    return got;
  }

  const wire::StudioKey key_ = wire::StudioKey::make();
  const wire::SigningKey cap01_ = wire::SigningKey::make();
  bus::MessageAuthenticator authenticator_;
  std::optional<wire::SessionMessage> challenge_;
  test::DatagramSender sender_{key_};
  bus::MessageReceiver receiver_{
      bus::ChannelList(),
      authenticator_,
      [](std::string_view) { return true; },
      {.send = [this](const wire::SessionMessage& challenge) { challenge_ = challenge; }}};
};

size_t limit() { return bus::max_encoded_bytes(wire::health_channel("cap01"), true); }

TEST(HealthSize, receivers_accept_all_values_of_100_cameras_with_the_longest_names_in_fault) {
  wire::HealthMessage health = health_of(100, kMaxCameraName);
  const size_t values = health.values.size();
  shorten_health(health, limit());
  EXPECT_EQ(health.values.size(), values);
  EXPECT_LE(encode(health).size(), limit());
  const auto got = Receiver().receive(health);
  ASSERT_TRUE(got);
  EXPECT_EQ(got->values.size(), values);
  EXPECT_THAT(got->text, EndsWith("; and 92 more cameras"));
}

TEST(HealthSize, health_of_any_number_of_cameras_is_shortened_to_what_receivers_accept) {
  for (const int cameras : {1, 50, 100, 140, 200, 400, 1000, 5000}) {
    for (const size_t name_size : {size_t{7}, size_t{13}, kMaxCameraName}) {
      wire::HealthMessage health = health_of(cameras, name_size);
      health.text += std::string(5000, 'x');
      shorten_health(health, limit());
      EXPECT_LE(encode(health).size(), limit()) << cameras << " cameras";
      EXPECT_TRUE(health.values.contains("value_of_the_node_79"));
      EXPECT_TRUE(Receiver().receive(health)) << cameras << " cameras";
    }
  }
}

TEST(HealthSize, omits_the_least_important_values_first_and_reports_it) {
  const auto shortened_to = [](size_t bytes) {
    wire::HealthMessage health = health_of(100, 13);
    shorten_health(health, bytes);
    return health;
  };
  const wire::HealthMessage whole = shortened_to(100'000);
  EXPECT_TRUE(whole.texts.contains("cam1000xxxxxx.model"));
  EXPECT_THAT(whole.text, Not(HasSubstr("health has no")));
  const wire::HealthMessage values = shortened_to(72'000);
  EXPECT_TRUE(values.texts.empty());
  EXPECT_TRUE(values.values.contains("cam1000xxxxxx.phase_us"));
  EXPECT_THAT(values.text,
              EndsWith("; health has no model and firmware of the cameras: too many for one "
                       "message"));
  const wire::HealthMessage important = shortened_to(bus::kMaxUnverifiedHealth);
  EXPECT_FALSE(important.values.contains("cam1000xxxxxx.phase_us"));
  EXPECT_TRUE(important.values.contains("cam1000xxxxxx.streaming_flag"));
  EXPECT_THAT(important.text, HasSubstr("health has no detailed values of the cameras"));
  const wire::HealthMessage node = shortened_to(10'000);
  EXPECT_FALSE(node.values.contains("cam1000xxxxxx.streaming_flag"));
  EXPECT_TRUE(node.values.contains("value_of_the_node_1"));
  EXPECT_THAT(node.text, HasSubstr("health has no values of the cameras"));
}

TEST(HealthSize, the_line_of_problems_names_eight_cameras_and_counts_the_others) {
  EXPECT_EQ(join_camera_problems({}), "");
  EXPECT_EQ(join_camera_problems({"a: lost", "b: lost"}), "a: lost; b: lost");
  EXPECT_EQ(join_camera_problems({"1", "2", "3", "4", "5", "6", "7", "8"}),
            "1; 2; 3; 4; 5; 6; 7; 8");
  EXPECT_EQ(join_camera_problems({"1", "2", "3", "4", "5", "6", "7", "8", "9"}),
            "1; 2; 3; 4; 5; 6; 7; 8; and 1 more cameras");
}

}  // namespace
}  // namespace v3d::node
