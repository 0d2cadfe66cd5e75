#include "calibrate/live_take.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <stdexcept>

#include "base/core/error.h"
#include "common/console.h"
#include "daemon/control/operator_client.h"
#include "take/take.h"
#include "v3dctl/operate/health_text.h"
#include "v3dctl/operate/pulse_train.h"
#include "v3dctl/operate/reply_text.h"
#include "v3dctl/process.h"
#include "v3dctl/takes/collect.h"

namespace v3d::calibrate {
namespace {

namespace fs = std::filesystem;

/// A low rate, because boards move slowly and similar images add little information.
constexpr double kMaxRateHz = 5;

/// From the local time, which operators read.
std::string new_take_name() {
  const std::time_t now = std::time(nullptr);
  std::tm local{};
  localtime_r(&now, &local);
  char text[40];
  std::strftime(text, sizeof text, "calibration-%Y%m%d-%H%M%S", &local);
  return text;
}

bool has_all_cameras(const TakePaths& paths, const Studio& studio) {
  return fs::exists(paths.info()) &&
         std::all_of(studio.cameras.begin(), studio.cameras.end(), [&](const StudioCamera& camera) {
           return fs::exists(paths.frames(camera.name));
         });
}

void record(const Studio& studio, const ctl::PulseTrain& train) {
  OperatorClient client(studio);
  StatusLine status;
  const auto show = [&] {
    const auto health = client.health(Monotonic::now());
    if (std::any_of(health.begin(), health.end(),
                    [](const auto& entry) { return ctl::is_in_take(entry.second); })) {
      status.show("recording " + train.take + ": " + ctl::recording_line(health));
    }
  };
  const ctl::TakeAccount account = ctl::merge_ledgers(run_train(client, studio, train, show));
  if (!account.ledger.complete()) note("v3dctl: " + account.ledger.verdict());
}

/// Copies the take from the nodes that recorded it.
fs::path collect(const Studio& studio, const std::string& name) {
  const fs::path here = fs::current_path();
  const auto collected = ctl::collect_takes(
      {.sources = ctl::sources_of(studio), .to = here, .takes = {name}, .rsh = {}});
  for (const ctl::CollectedTake& take : collected) {
    if (!take.problem.empty()) throw std::runtime_error(name + ": " + take.problem);
  }
  return here / name;
}

}  // namespace

fs::path record_live_take(const Studio& studio, double seconds) {
  ctl::PulseTrain train{.take = new_take_name()};
  train.rate_hz = std::min(kMaxRateHz, studio.trigger.rate_hz);
  train.pulses = std::max<int64_t>(1, std::llround(seconds * train.rate_hz));
  record(studio, train);
  const TakePaths recorded{(studio.storage.takes / train.take).lexically_normal()};
  const fs::path take =
      has_all_cameras(recorded, studio) ? recorded.folder : collect(studio, train.take);
  note("v3dctl: the images are kept in the take " + take.string() + "; use them again with --take");
  return take;
}

}  // namespace v3d::calibrate
