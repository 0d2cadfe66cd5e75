#include "recon/pipeline/frame_pipeline.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <atomic>
#include <stdexcept>
#include <string>

#include "recon/pipeline/reconstructor.h"
#include "recon/shapes.h"

namespace v3d::recon {
namespace {

using testing::ElementsAre;
using testing::ElementsAreArray;

/// The numbers 0, 1, 2, ... count - 1.
FramePipeline<int>::Source count_to(int count) {
  return
      [count, next = 0]() mutable { return next < count ? std::optional(next++) : std::nullopt; };
}

std::vector<int> numbers(int count) {
  std::vector<int> all;
  for (int i = 0; i < count; ++i) all.push_back(i);
  return all;
}

/// Log of events, in order. Thread-safe.
class Diary {
 public:
  void write(const std::string& what) {
    const std::lock_guard lock(mutex_);
    lines_.push_back(what);
    written_.notify_all();
  }
  /// Waits for an event. Returns false when it is not written within ten seconds.
  bool wait_for(const std::string& what) {
    std::unique_lock lock(mutex_);
    return written_.wait_for(lock, std::chrono::seconds(10), [&] {
      return std::find(lines_.begin(), lines_.end(), what) != lines_.end();
    });
  }
  const std::vector<std::string>& lines() const { return lines_; }

 private:
  std::mutex mutex_;
  std::condition_variable written_;
  std::vector<std::string> lines_;
};

TEST(FramePipeline, runs_every_stage_once_for_every_frame_in_order) {
  for (const int threads : {1, 2, 5}) {
    std::vector<int> seen[3];  // a stage has one frame at a time: no lock
    const auto note = [&](size_t stage) {
      return [&, stage](int& n) { seen[stage].push_back(n); };
    };
    FramePipeline<int>(threads, count_to(500), {note(0), note(1), note(2)}).wait();
    for (const auto& stage : seen) EXPECT_THAT(stage, ElementsAreArray(numbers(500))) << threads;
  }
}

TEST(FramePipeline, processes_consecutive_frames_concurrently) {
  Diary diary;
  bool met = true;
  FramePipeline<int> pipeline(2, count_to(2),
                              {[&](int& n) {
                                 diary.write("shape " + std::to_string(n));
                                 if (n == 1) met = diary.wait_for("code 0");
                               },
                               [&](int& n) {
                                 if (n == 0) diary.wait_for("shape 1");
                                 diary.write("code " + std::to_string(n));
                               }});
  pipeline.wait();
  EXPECT_TRUE(met);
  EXPECT_EQ(diary.lines().at(1), "shape 1") << "began while frame 0 was still coded";
}

TEST(FramePipeline, finishes_the_older_frame_first_when_there_is_one_thread) {
  Diary diary;
  const auto note = [&](const std::string& stage) {
    return [&diary, stage](int& n) { diary.write(stage + std::to_string(n)); };
  };
  FramePipeline<int>(1, count_to(3), {note("a"), note("b"), note("c")}).wait();
  EXPECT_THAT(diary.lines(), ElementsAre("a0", "b0", "c0", "a1", "b1", "c1", "a2", "b2", "c2"));
}

TEST(FramePipeline, has_at_most_one_frame_a_stage_and_the_requested_threads) {
  constexpr int kThreads = 2;
  std::atomic<int> in_flight = 0, working = 0, max_in_flight = 0, max_working = 0;
  const auto raise = [](std::atomic<int>& most, int value) {
    for (int known = most; known < value && !most.compare_exchange_weak(known, value);) {
    }
  };
  int next = 0;
  const auto source = [&]() -> std::optional<int> {
    if (next == 200) return std::nullopt;
    raise(max_in_flight, ++in_flight);
    return next++;
  };
  const auto work = [&](int&) {
    tbb::parallel_for(0, 8, [&](int) {
      raise(max_working, ++working);
      --working;
    });
  };
  FramePipeline<int>(kThreads, source, {work, work, [&](int&) { --in_flight; }}).wait();
  EXPECT_LE(max_in_flight, 3);
  EXPECT_LE(max_working, kThreads);
}

TEST(FramePipeline, requests_a_frame_only_when_it_can_start_it) {
  Diary diary;
  int asked = 0, asked_while_busy = -1;
  const auto source = [&]() -> std::optional<int> {
    diary.write("asked " + std::to_string(++asked));
    return asked <= 3 ? std::optional(asked) : std::nullopt;
  };
  FramePipeline<int> pipeline(1, source, {[&](int& n) {
                                asked_while_busy = asked;
                                diary.write("worked on " + std::to_string(n));
                              }});
  pipeline.wait();
  EXPECT_THAT(diary.lines(), ElementsAre("asked 1", "worked on 1", "asked 2", "worked on 2",
                                         "asked 3", "worked on 3", "asked 4"));
  EXPECT_EQ(asked_while_busy, 3);
}

TEST(FramePipeline, ends_at_the_first_exception_and_throws_it_from_wait) {
  for (const int threads : {1, 4}) {
    std::vector<int> through;
    FramePipeline<int> pipeline(threads, count_to(1000),
                                {[](int& n) {
                                   if (n == 5) throw std::runtime_error("five");
                                 },
                                 [&](int& n) { through.push_back(n); }});
    EXPECT_THROW(pipeline.wait(), std::runtime_error);
    EXPECT_LE(through.size(), 5U);
    EXPECT_THAT(through, ElementsAreArray(numbers(static_cast<int>(through.size()))));
  }
  const auto broken = []() -> std::optional<int> { throw std::runtime_error("no source"); };
  FramePipeline<int> pipeline(2, broken, {[](int&) {}});
  EXPECT_THROW(pipeline.wait(), std::runtime_error);
}

TEST(FramePipeline, ends_without_frames) {
  FramePipeline<int>(2, [] { return std::optional<int>(); }, {[](int&) { FAIL(); }}).wait();
}

// --- the real stages ----------------------------------------------------------------------------

constexpr ImageSize kSize{120, 90};

Rig ring(int count) {
  Rig rig;
  for (int i = 0; i < count; ++i) {
    const double angle = 2 * std::numbers::pi * i / count;
    rig.push_back({"cam" + std::to_string(i),
                   shapes::camera({2 * std::cos(angle), 2 * std::sin(angle), 1 + 0.8 * (i % 3)},
                                  {0, 0, 1}, kSize, 115)});
  }
  return rig;
}

/// Discs whose radius grows with the pulse, on a grey background that gets lighter with it.
FrameSet discs(const Rig& rig, int64_t pulse) {
  FrameSet set;
  set.pulse = pulse;
  const int radius = 8 + static_cast<int>(2 * pulse);
  for (const RigCamera& camera : rig) {
    Mask mask(kSize);
    for (int y = 0; y < kSize.height; ++y) {
      for (int x = 0; x < kSize.width; ++x) {
        const int dx = x - kSize.width / 2, dy = y - kSize.height / 2;
        if (dx * dx + dy * dy < radius * radius) mask.set(x, y);
      }
    }
    Image raw(kSize, PixelFormat::kBayerRG8);
    std::fill(raw.bytes.begin(), raw.bytes.end(), static_cast<uint8_t>(20 * pulse));
    FrameLabel label;
    label.pulse = pulse;
    set.frames.push_back(observe(camera.name, label, raw.view(), std::move(mask)));
  }
  return set;
}

TEST(FramePipeline, returns_the_bytes_of_sequential_processing_for_any_number_of_threads) {
  constexpr int64_t kPulses = 8;
  const Rig rig = ring(7);
  ReconstructOptions options{
      .bounds = {{-0.6, -0.6, 0.4}, {0.6, 0.6, 1.6}}, .voxel_m = 0.03, .min_views = 3};
  std::vector<std::vector<uint8_t>> expected;
  {
    Reconstructor alone(rig, options);
    for (int64_t p = 0; p < kPulses; ++p) {
      FrameSetJob work(discs(rig, p));
      alone.make_mesh(work);
      alone.encode(work);
      expected.push_back(std::move(work.result.compact));
    }
  }
  EXPECT_EQ(std::adjacent_find(expected.begin(), expected.end()), expected.end());
  for (const int threads : {1, 2, 5}) {
    Reconstructor reconstructor(rig, options);
    std::vector<std::vector<uint8_t>> compact;
    int64_t next = 0;
    FramePipeline<FrameSetJob>(threads,
                               [&]() -> std::optional<FrameSetJob> {
                                 if (next == kPulses) return std::nullopt;
                                 return FrameSetJob(discs(rig, next++));
                               },
                               {[&](FrameSetJob& work) { reconstructor.make_mesh(work); },
                                [&](FrameSetJob& work) {
                                  reconstructor.encode(work);
                                  compact.push_back(std::move(work.result.compact));
                                }})
        .wait();
    EXPECT_EQ(compact, expected) << threads << " threads";
  }
}

}  // namespace
}  // namespace v3d::recon
