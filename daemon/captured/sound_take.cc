#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "daemon/captured/node_sound.h"
#include "daemon/captured/timecode_output.h"
#include "sound/timecode.h"
#include "take/ledger/sound_mapping.h"
#include "take/take_sound.h"

namespace v3d::captured {
namespace {

/// A second of sound is on the disk one period and the duration of a sync later.
constexpr Duration kSyncPeriod = std::chrono::milliseconds(500);
constexpr auto kDefaultTimecode = sound::TimecodeRate::k25;

/// The run of frames through two positions of a recording: at `sample` the timecode has `frames`,
/// with their fraction, since midnight.
sound::TimecodeRun run_through(double sample, double frames, double later_sample,
                               double later_frames) {
  const double pitch = (later_sample - sample) / (later_frames - frames);
  return {.first_sample = sample - (frames - std::floor(frames)) * pitch,
          .first_frame = std::llround(std::floor(frames)),
          .last_sample = later_sample - (later_frames - std::floor(later_frames)) * pitch,
          .last_frame = std::llround(std::floor(later_frames))};
}

}  // namespace

SoundTake::SoundTake(Setup setup, std::shared_ptr<SoundQueue> queue)
    : setup_(std::move(setup)),
      track_({.sound = setup_.sound,
              .pulse_rate_hz = setup_.pulse_rate_hz,
              .stamp_uncertainty_s = setup_.stamp_uncertainty_s}),
      counts_{.position = setup_.position},
      receiver_(std::move(queue), [this](const sound::SoundBlock& block) { process(block); }) {}

SoundTake::Counts SoundTake::counts() const {
  const std::lock_guard lock(mutex_);
  return counts_;
}

void SoundTake::process(const sound::SoundBlock& block) {
  take_pulses();
  if (written_) append(block);  // samples after a gap in the file would have wrong positions
  const std::lock_guard lock(mutex_);
  counts_.position = block.position + std::ssize(block.values) / setup_.sound.channels;
}

void SoundTake::append(const sound::SoundBlock& block) {
  if (!file_) written_ = create_file(block);
  if (written_) written_ = write(block, track_.add(block));
  const std::lock_guard lock(mutex_);
  counts_.samples = track_.samples();
  counts_.xruns = track_.xruns();
  count_jumps();
  if (!written_) {
    counts_.error = written_.error().message;
    spdlog::error("{}", counts_.error);
  }
}

/// Requires the lock of mutex_.
void SoundTake::count_jumps() {
  const auto& timecode = track_.timecode();
  if (!timecode || timecode->jumps() == counts_.timecode_jumps) return;
  counts_.timecode_jumps = timecode->jumps();
  const auto text = [&](int64_t frame) {
    return sound::timecode_text(sound::timecode_of(frame, *timecode->rate()), *timecode->rate());
  };
  const sound::TimecodeJump& first = *timecode->first_jump();
  counts_.first_jump = text(first.found) + " instead of " + text(first.expected);
}

void SoundTake::take_pulses() {
  for (const capture::PulseEdge& pulse : receiver_.pop_pulses()) {
    track_.add_pulse(pulse.pulse, pulse.at);
    if (!first_pulse_) first_pulse_ = pulse;
    last_pulse_ = pulse;
  }
}

io::Status SoundTake::create_file(const sound::SoundBlock& first) {
  if (auto created = io::create_folders(setup_.paths.sound()); !created) return created;
  auto path = take::next_sound_file(setup_.paths, setup_.sound.node);
  if (!path) return tl::make_unexpected(path.error());
  path_ = *path;
  const auto samples = static_cast<double>(first.values.size()) / setup_.sound.channels;
  const MonotonicInstant begin = first.at - from_seconds(samples / setup_.sound.rate_hz);
  auto created = sound::WaveWriter::create(
      path_, {.rate_hz = setup_.sound.rate_hz, .channels = setup_.sound.channels},
      sound::wave_origin(to_realtime(begin), setup_.sound.rate_hz,
                         "take " + setup_.take + ", node " + setup_.sound.node, "V3D"));
  if (!created) return tl::make_unexpected(created.error());
  file_.emplace(*std::move(created));
  syncing_.emplace(file_->file(), kSyncPeriod);
  return io::sync_folder(setup_.paths.sound());
}

io::Status SoundTake::write(const sound::SoundBlock& block, int64_t silence) {
  // Most blocks follow without a gap, and must not cost the memory of a second of silence.
  if (silence > 0) {
    if (auto done = write_silence(silence); !done) return done;
  }
  if (auto done = file_->write(block.values); !done) return done;
  syncing_->mark_dirty();
  return syncing_->pop_error();
}

io::Status SoundTake::write_silence(int64_t samples) {
  const std::vector<int32_t> second(
      static_cast<size_t>(setup_.sound.rate_hz * setup_.sound.channels));
  for (int64_t left = samples * setup_.sound.channels; left > 0;) {
    const auto count = std::min<int64_t>(left, std::ssize(second));
    const std::span values(second.data(), static_cast<size_t>(count));
    if (auto done = file_->write(values); !done) return done;
    left -= count;
  }
  return {};
}

std::optional<take::SoundLedger> SoundTake::close() {
  receiver_.stop();
  if (!file_) return std::nullopt;
  take_pulses();
  track_.finish();
  take::SoundLedger ledger = describe();
  const auto rate = sound::timecode_rate_from_name(ledger.timecode_rate);
  io::Status done = file_->finish(
      rate ? sound::first_timecode(ledger.timecode_runs, *rate, ledger.rate_hz) : std::nullopt);
  if (done) syncing_->mark_dirty();
  if (auto synced = syncing_->sync(); done) done = std::move(synced);
  syncing_.reset();
  if (!done) {
    const std::lock_guard lock(mutex_);
    counts_.error = done.error().message;
  }
  return ledger;
}

take::SoundLedger SoundTake::describe() const {
  take::SoundLedger ledger;
  ledger.file = setup_.paths.sound().filename() / path_.filename();
  ledger.node = setup_.sound.node;
  ledger.rate_hz = setup_.sound.rate_hz;
  ledger.channels = setup_.sound.channels;
  ledger.samples = file_->samples();
  ledger.xruns = track_.xruns();
  for (const sound::SoundGap& gap : track_.gaps()) {
    ledger.gaps.push_back({static_cast<double>(gap.sample), static_cast<double>(gap.samples)});
  }
  ledger.lost_samples = track_.lost_samples();
  // LTC is known without pulses, too.
  take::describe_track(track_, first_pulse_ ? first_pulse_->pulse : 0,
                       last_pulse_ ? last_pulse_->pulse : 0, ledger);
  if (first_pulse_ && ledger.timecode_source == "none") describe_generated(ledger);
  return ledger;
}

void SoundTake::describe_generated(take::SoundLedger& ledger) const {
  const sound::PulseMap& map = ledger.map;
  const auto day_rate = sound::timecode_rate_from_name(setup_.sound.timecode_rate);
  const sound::TimecodeClock clock =
      setup_.timecode ? setup_.timecode()
                      : day_clock(day_rate.value_or(kDefaultTimecode), first_pulse_->at);
  const sound::TimecodeRate rate = clock.rate();
  const double first = clock.frames_at(first_pulse_->at);
  const double last = clock.frames_at(last_pulse_->at);
  // Rounded as by timecode_frames_at().
  const double half_sample = 0.5 * sound::frames_per_second(rate) / setup_.sound.rate_hz;
  const auto text = [&](double frames) {
    return take::PulseTimecode{.rate = rate, .frames = frames + half_sample}.text();
  };
  ledger.timecode_source = setup_.timecode ? "output" : "time of day";
  ledger.timecode_rate = name(rate);
  ledger.first_timecode = text(first);
  ledger.last_timecode = text(last);
  if (!map.is_known() || first_pulse_->pulse >= last_pulse_->pulse) return;
  ledger.timecode_runs = {run_through(map.sample_of(static_cast<double>(first_pulse_->pulse)),
                                      first, map.sample_of(static_cast<double>(last_pulse_->pulse)),
                                      last)};
}

}  // namespace v3d::captured
