#include "daemon/recond/live_repair.h"

#include <spdlog/spdlog.h>

#include <utility>

#include "base/core/text.h"

namespace v3d::recond {

LiveRepair::LiveRepair(Setup setup, std::function<size_t()> waiting)
    : setup_(std::move(setup)), waiting_(std::move(waiting)), list_(setup_.list) {}

std::optional<recon::RepairedFrameSet> LiveRepair::repair(recon::FrameSet& set) {
  return setup_.repair(set, [this] { return RepairLoadControl::must_stop(waiting_()); });
}

LiveRepair::Result LiveRepair::run(recon::FrameSet& set) {
  const bool starts = load_.may_start(waiting_());
  auto repaired = starts ? repair(set) : std::nullopt;
  if (repaired) {
    load_.on_finished();
    count(set.pulse, repaired->faults);
    return {.started = true, .replaced = std::move(repaired->replaced)};
  }
  if (starts) load_.on_stopped();
  const std::lock_guard lock(mutex_);
  ++counts_.unchecked;
  counts_.stopped += starts ? 1 : 0;
  return {.started = starts};
}

void LiveRepair::warm_up(recon::FrameSet& set) { repair(set); }

void LiveRepair::record(int64_t pulse) {
  const io::Status added = list_.add(pulse);
  if (added) return;
  const std::lock_guard lock(mutex_);
  if (++counts_.write_errors == 1) spdlog::error("{}", added.error().message);
}

void LiveRepair::count(int64_t pulse, const std::vector<recon::SilhouetteFault>& faults) {
  const std::lock_guard lock(mutex_);
  ++counts_.checked;
  counts_.repaired += faults.empty() ? 0 : 1;
  for (const recon::SilhouetteFault& fault : faults) {
    CameraRepairs& camera = counts_.cameras[setup_.cameras[fault.camera]];
    const bool is_first = camera.pulses == 0 || camera.last_pulse != pulse;
    camera.pulses += is_first ? 1 : 0;
    camera.pixels += fault.pixels;
    camera.left_out += fault.kind == recon::SilhouetteFaultKind::kWholeCamera ? 1 : 0;
    if (!is_first && fault.pixels <= camera.last_pixels) continue;
    camera.last_pulse = pulse;
    camera.last_kind = name(fault.kind);
    camera.last_region = fault.region;
    camera.last_pixels = fault.pixels;
  }
}

RepairCounts LiveRepair::counts() const {
  const std::lock_guard lock(mutex_);
  return counts_;
}

std::string text_of_last_fault(const CameraRepairs& repairs) {
  const Rect& region = repairs.last_region;
  return repairs.last_kind + " of " + format_count(repairs.last_pixels) +
         " pixels, in the region " + std::to_string(region.width) + " x " +
         std::to_string(region.height) + " at x " + std::to_string(region.x0) + ", y " +
         std::to_string(region.y0);
}

}  // namespace v3d::recond
