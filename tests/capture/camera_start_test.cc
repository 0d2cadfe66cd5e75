// CameraSession with pulses whose times are wrong.

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>

#include "capture/cameras/camera_session.h"
#include "pilot_fixture.h"

namespace v3d::capture {
namespace {

using std::chrono::milliseconds;

class StartingCameraSessionTest : public SensedCameraSessionTest {
 protected:
  int64_t wrong_and_certain() const {
    return std::ranges::count_if(frames_, [](const Frame& f) {
      return !f.label.suspect && f.label.pulse % 256 != f.image.bytes[0];
    });
  }
};

TEST_F(StartingCameraSessionTest,
       suspects_a_train_whose_pulses_seem_to_be_later_than_their_frames) {
  for (const int ms : {15, 30, 45, 60, 90}) {
    time_error_ = milliseconds(ms);
    train(50);
    ASSERT_EQ(frames_.size(), 50U);
    EXPECT_EQ(session_->status().suspect, 50) << ms;
  }
}

RC_GTEST_FIXTURE_PROP(StartingCameraSessionTest,
                      is_never_certain_of_a_wrong_number_however_wrong_the_times_of_pulses_are,
                      ()) {
  time_error_ = std::chrono::microseconds(*rc::gen::inRange(-120'000, 120'001));
  report_delay_ = milliseconds(*rc::gen::inRange(0, 400));
  if (*rc::gen::arbitrary<bool>()) train(16);
  if (*rc::gen::arbitrary<bool>()) {
    time_error_ = std::chrono::microseconds(*rc::gen::inRange(-120'000, 120'001));
  }
  train(40);
  RC_ASSERT(wrong_and_certain() == 0);
}

}  // namespace
}  // namespace v3d::capture
