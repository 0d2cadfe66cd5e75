// A recording program is killed at random moments. It acknowledges every frame that was written.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/prctl.h>
#include <unistd.h>

#include <csignal>
#include <map>
#include <random>
#include <set>

#include "base/io/file.h"
#include "recording.h"
#include "support/begun_take.h"
#include "support/temporary_folder.h"
#include "support/wait_for_child.h"
#include "take/ledger/verify.h"
#include "take/logs/frame_log.h"
#include "wire/codec.h"

namespace v3d::take {
namespace {

using testing::IsEmpty;

constexpr int kKills = 200;
constexpr ImageSize kSize{640, 480};
const std::vector<std::string> kCameras = {"cam01", "cam02"};

struct Acknowledgement {
  int64_t camera = 0;
  int64_t pulse = 0;
};

/// The program: records pulses until it is killed.
[[noreturn]] void record(const TakePaths& paths, int acknowledge) {
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  EventLogWriter pulses(paths.pulses());
  std::vector<EventLogWriter> logs;
  for (const std::string& camera : kCameras) logs.emplace_back(paths.frames(camera));
  for (int64_t pulse = 0;; ++pulse) {
    wire::PulseMessage sensed;
    sensed.pulse = pulse;
    if (!pulses.write(sensed)) _exit(1);
    for (size_t c = 0; c < logs.size(); ++c) {
      if (!logs[c].write(test::recorded_frame(kCameras[c], pulse, kSize))) _exit(1);
      const Acknowledgement done{static_cast<int64_t>(c), pulse};
      if (write(acknowledge, &done, sizeof done) != sizeof done) _exit(1);
    }
  }
}

/// Runs the program, and kills it `after` it has sent acknowledgement number `kill_at`. Returns all
/// acknowledged pulses by camera. Fails the test when the program ends by itself.
std::map<size_t, std::set<int64_t>> record_and_kill(const TakePaths& paths, int kill_at,
                                                    Duration after) {
  int channel[2];
  if (pipe2(channel, O_CLOEXEC) != 0) {
    ADD_FAILURE() << "pipe2() failed";
    return {};
  }
  const pid_t child = fork();
  if (child == 0) {
    close(channel[0]);
    record(paths, channel[1]);
  }
  close(channel[1]);
  std::map<size_t, std::set<int64_t>> acknowledged;
  Acknowledgement done;
  int received = 0;
  while (read(channel[0], &done, sizeof done) == sizeof done) {
    acknowledged[static_cast<size_t>(done.camera)].insert(done.pulse);
    if (++received != kill_at) continue;
    const MonotonicInstant then = Monotonic::now() + after;
    while (Monotonic::now() < then) {
    }
    kill(child, SIGKILL);
  }
  close(channel[0]);
  EXPECT_EQ(test::wait_for_child(child), test::kKilled) << "the program ended by itself";
  EXPECT_GE(received, kill_at);
  return acknowledged;
}

TakePaths begin_take(const std::filesystem::path& folder) {
  const TakePaths paths{folder};
  std::filesystem::create_directories(folder);
  EXPECT_TRUE(save_take_info(paths, test::begun_take(kCameras)));
  test::write_text(paths.calib(), "");
  return paths;
}

/// Number of whole events from the length of the file: all events of a camera have the same length.
int64_t whole_frames(const TakePaths& paths, const std::string& camera) {
  const size_t event = 28 + std::string("V3D_FRAME_").size() + camera.size() +
                       encode(test::recorded_frame(camera, 0, kSize)).size();
  return static_cast<int64_t>(std::filesystem::file_size(paths.frames(camera)) / event);
}

void expect_every_acknowledged_frame(const TakePaths& paths, const std::string& camera,
                                     const std::set<int64_t>& acknowledged) {
  FrameLogReader log(paths.frames(camera));
  for (const int64_t pulse : acknowledged) {
    const auto frame = log.read(pulse);
    ASSERT_TRUE(frame) << camera << ", pulse " << pulse << " was acknowledged";
    EXPECT_EQ(frame->image.bytes, test::recorded_frame(camera, pulse, kSize).frame.image.bytes);
  }
}

void expect_correct_ledger(const Verification& verified, const TakePaths& paths) {
  for (const CameraLedger& camera : verified.ledger.cameras) {
    const int64_t frames = whole_frames(paths, camera.name);
    EXPECT_EQ(camera.written, frames) << camera.name;
    std::vector<int64_t> missing;
    for (int64_t pulse = frames; pulse < verified.ledger.commanded; ++pulse) {
      missing.push_back(pulse);
    }
    EXPECT_EQ(camera.missing, missing) << camera.name;
    EXPECT_THAT(camera.duplicate, IsEmpty());
    EXPECT_THAT(camera.suspect, IsEmpty());
  }
}

TEST(KilledRecording, keeps_every_acknowledged_frame_and_a_correct_ledger) {
  std::mt19937 random(5);
  for (int i = 0; i < kKills && !HasFailure(); ++i) {
    SCOPED_TRACE("kill " + std::to_string(i));
    const test::TemporaryFolder folder;
    const TakePaths paths = begin_take(folder / "kendo-07");
    const int kill_at = 1 + static_cast<int>(random() % 16);
    const auto acknowledged =
        record_and_kill(paths, kill_at, std::chrono::microseconds(random() % 500));
    for (size_t c = 0; c < kCameras.size(); ++c) {
      const auto of_camera = acknowledged.find(c);
      if (of_camera == acknowledged.end()) continue;
      expect_every_acknowledged_frame(paths, kCameras[c], of_camera->second);
    }
    expect_correct_ledger(verify_take(paths), paths);
    recover_take(paths);
    const Verification recovered = verify_take(paths);
    expect_correct_ledger(recovered, paths);
    EXPECT_THAT(recovered.disagreements, IsEmpty());
    EXPECT_EQ(recovered.info.state, TakeState::kRecovered);
  }
}

}  // namespace
}  // namespace v3d::take
