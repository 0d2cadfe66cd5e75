#include "daemon/recond/displacement_monitor.h"

#include <gtest/gtest.h>
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <pthread.h>
#include <sched.h>
#include <sys/prctl.h>
#include <sys/syscall.h>

#include <array>
#include <cerrno>
#include <cmath>
#include <cstddef>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <numbers>
#include <sstream>
#include <stop_token>
#include <string>
#include <thread>
#include <vector>

#include "recon/render/renderer.h"
#include "support/child_process.h"
#include "tests/recon/shapes.h"

namespace v3d::recond {
namespace {

using test::becomes_true;
using test::within;

Rig ring_of(size_t cameras) {
  Rig rig;
  for (size_t i = 0; i < cameras; ++i) {
    const double angle =
        2 * std::numbers::pi * static_cast<double>(i) / static_cast<double>(cameras);
    rig.push_back(
        {"cam" + std::to_string(i),
         recon::shapes::camera({3 * std::cos(angle), 3 * std::sin(angle), i % 2 ? 1.0 : -1.0},
                               {0, 0, 0}, {160, 120}, 250)});
  }
  return rig;
}

recon::ReconstructOptions in_a_small_space() {
  return {.bounds = {{-0.6, -0.6, -0.6}, {0.6, 0.6, 0.6}}, .min_views = 3};
}

recon::FrameSet seen_by(const Rig& rig) {
  recon::FrameSet set;
  for (const RigCamera& camera : rig) {
    Frame frame;
    frame.camera = camera.name;
    frame.mask =
        recon::draw_silhouette(recon::shapes::sphere({0.1F, -0.1F, 0}, 0.25F, 24), camera.model);
    set.frames.push_back(std::move(frame));
  }
  return set;
}

TEST(DisplacementMonitor, moves_all_masks_out_of_a_set) {
  const Rig rig = ring_of(DisplacementMonitor::kMinCameras);
  DisplacementMonitor monitor(rig, in_a_small_space());
  recon::FrameSet set = seen_by(rig);
  // offer() does not wait for the lock, so the first calls may leave the masks.
  EXPECT_TRUE(becomes_true(
      [&] {
        monitor.offer(set);
        return !set.frames[0].mask;
      },
      within(60)));
  for (const Frame& frame : set.frames) EXPECT_FALSE(frame.mask) << frame.camera;
  EXPECT_FALSE(monitor.has_stopped());
}

/// Number of threads of this process with the policy SCHED_IDLE (/proc/self/task/TID/stat, field
/// 41).
int64_t idle_priority_threads() {
  int64_t count = 0;
  for (const auto& thread : std::filesystem::directory_iterator("/proc/self/task")) {
    std::ifstream in(thread.path() / "stat");
    std::string text;
    std::getline(in, text);
    std::istringstream fields(text.substr(text.rfind(')') + 1));  // from field 3 on
    const std::vector<std::string> values{std::istream_iterator<std::string>(fields), {}};
    constexpr size_t kPolicy = 41 - 3;
    if (values.size() > kPolicy && values[kPolicy] == std::to_string(SCHED_IDLE)) ++count;
  }
  return count;
}

TEST(DisplacementMonitor, works_on_one_thread_of_idle_priority) {
  ASSERT_EQ(idle_priority_threads(), 0);
  DisplacementMonitor monitor(ring_of(DisplacementMonitor::kMinCameras), in_a_small_space());
  EXPECT_TRUE(becomes_true([] { return idle_priority_threads() == 1; }, within(60)));
}

/// True when this process may leave SCHED_IDLE.
bool may_raise_priority() {
  bool may = false;
  std::thread([&] {
    const sched_param none{};
    may = pthread_setschedparam(pthread_self(), SCHED_IDLE, &none) == 0 &&
          pthread_setschedparam(pthread_self(), SCHED_OTHER, &none) == 0;
  }).join();
  return may;
}

/// Uses every processor until it is destroyed.
class BusyProcessors {
 public:
  BusyProcessors() {
    for (unsigned i = 0; i < std::thread::hardware_concurrency(); ++i) {
      threads_.emplace_back([](const std::stop_token& stop) {
        while (!stop.stop_requested()) continue;
      });
    }
  }

 private:
  std::vector<std::jthread> threads_;
};

TEST(DisplacementMonitor, raises_its_priority_on_a_busy_machine_until_it_has_a_result) {
  if (!may_raise_priority()) GTEST_SKIP() << "needs CAP_SYS_NICE or RLIMIT_NICE";
  const Rig rig = ring_of(DisplacementMonitor::kMinCameras);
  DisplacementMonitor monitor(rig, in_a_small_space(), std::chrono::milliseconds(50));
  const auto offered_until = [&](auto condition) {
    return becomes_true(
        [&] {
          recon::FrameSet set = seen_by(rig);
          monitor.offer(set);
          return condition();
        },
        within(120));
  };
  {
    const BusyProcessors busy;
    EXPECT_TRUE(offered_until([] { return idle_priority_threads() == 0; }));
    EXPECT_TRUE(monitor.result().empty());
  }
  EXPECT_TRUE(offered_until([&] { return !monitor.result().empty(); }));
  EXPECT_TRUE(becomes_true([] { return idle_priority_threads() == 1; }, within(60)));
}

/// Threads that this thread starts from now on cannot set a priority, as under v3d-recond@.service.
bool forbid_priorities() {
  std::array<sock_filter, 5> filter{
      sock_filter BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offsetof(seccomp_data, nr)),
      sock_filter BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, SYS_sched_setscheduler, 1, 0),
      sock_filter BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, SYS_setpriority, 0, 1),
      sock_filter BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ERRNO | EPERM),
      sock_filter BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ALLOW)};
  const sock_fprog program{static_cast<unsigned short>(filter.size()), filter.data()};
  return prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) == 0 &&
         prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &program) == 0;
}

/// Passes a monitor whose thread has normal priority to `test`.
void with_normal_priority(Duration starved_after,
                          const std::function<void(DisplacementMonitor&)>& test) {
  std::thread([&] {
    ASSERT_TRUE(forbid_priorities());
    DisplacementMonitor monitor(ring_of(DisplacementMonitor::kMinCameras), in_a_small_space(),
                                starved_after);
    test(monitor);
  }).join();
}

bool gets_a_result(DisplacementMonitor& monitor) {
  const Rig rig = ring_of(DisplacementMonitor::kMinCameras);
  return becomes_true(
      [&] {
        recon::FrameSet set = seen_by(rig);
        monitor.offer(set);
        return !monitor.result().empty();
      },
      within(120));
}

TEST(DisplacementMonitor, pauses_while_a_set_is_reconstructed_where_idle_priority_is_forbidden) {
  with_normal_priority(std::chrono::hours(1), [](DisplacementMonitor& monitor) {
    monitor.begin_set();
    recon::FrameSet set = seen_by(ring_of(DisplacementMonitor::kMinCameras));
    EXPECT_TRUE(becomes_true(
        [&] {
          monitor.offer(set);
          return monitor.is_paused();
        },
        within(60)));
    EXPECT_EQ(idle_priority_threads(), 0);
    monitor.end_set();
    EXPECT_TRUE(gets_a_result(monitor));
    EXPECT_FALSE(monitor.is_paused());
  });
}

TEST(DisplacementMonitor, has_a_result_although_sets_are_always_reconstructed) {
  with_normal_priority(std::chrono::milliseconds(50), [](DisplacementMonitor& monitor) {
    monitor.begin_set();
    EXPECT_TRUE(gets_a_result(monitor));
  });
}

TEST(DisplacementMonitor, stops_while_it_is_paused) {
  with_normal_priority(std::chrono::hours(1), [](DisplacementMonitor& monitor) {
    monitor.begin_set();
    recon::FrameSet set = seen_by(ring_of(DisplacementMonitor::kMinCameras));
    ASSERT_TRUE(becomes_true(
        [&] {
          monitor.offer(set);
          return monitor.is_paused();
        },
        within(60)));
    monitor.stop();
    EXPECT_TRUE(becomes_true([&] { return monitor.has_stopped(); }, within(60)));
  });
}

TEST(DisplacementMonitor, stops_without_waiting_and_takes_no_more_masks) {
  const Rig rig = ring_of(DisplacementMonitor::kMinCameras);
  DisplacementMonitor monitor(rig, in_a_small_space());
  monitor.stop();
  ASSERT_TRUE(becomes_true([&] { return monitor.has_stopped(); }, within(60)));
  recon::FrameSet set = seen_by(rig);
  monitor.offer(set);
  EXPECT_TRUE(set.frames[0].mask);
}

TEST(DisplacementMonitor, does_nothing_with_too_few_cameras) {
  const Rig rig = ring_of(DisplacementMonitor::kMinCameras - 1);
  DisplacementMonitor monitor(rig, in_a_small_space());
  recon::FrameSet set = seen_by(rig);
  monitor.offer(set);
  EXPECT_TRUE(set.frames[0].mask);
  EXPECT_TRUE(monitor.has_stopped());
}

}  // namespace
}  // namespace v3d::recond
