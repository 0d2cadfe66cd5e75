// Sound of a capture node: its device, the recording of a take, and the health of both.
#pragma once

#include <atomic>
#include <condition_variable>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "base/config/studio_file.h"
#include "base/io/file.h"
#include "capture/sync/pulse_times.h"
#include "daemon/bus/event_sender.h"
#include "daemon/captured/sound_receiver.h"
#include "daemon/captured/timecode_output.h"
#include "sound/level_monitor.h"
#include "sound/sound_device.h"
#include "sound/sound_track.h"
#include "sound/timecode_clock.h"
#include "sound/wave_file.h"
#include "take/ledger/sound_ledger.h"
#include "take/logs/log_files.h"
#include "take/take.h"
#include "wire/messages.h"

namespace v3d::captured {

/// The timecode that this node puts out; empty: none. Any thread.
using TimecodeSource = std::function<sound::TimecodeClock()>;

/// Writes the sound of one take, in a thread of its own: <node>.wav, from the first block on. A
/// fault of the disk ends the sound file, and nothing else.
class SoundTake {
 public:
  struct Setup {
    StudioSound sound;
    take::TakePaths paths;
    std::string take;
    double pulse_rate_hz = 25;
    double stamp_uncertainty_s = 1e-3;
    TimecodeSource timecode = {};
    int64_t position = 0;  ///< of the device at the start
  };
  /// `queue`: the blocks of the device.
  SoundTake(Setup setup, std::shared_ptr<SoundQueue> queue);

  /// A pulse of the take. Any thread.
  void pulse_at(const capture::PulseEdge& edge) { receiver_.pulse_at(edge); }

  struct Counts {
    int64_t samples = 0;
    int64_t xruns = 0;
    int64_t timecode_jumps = 0;
    std::string first_jump{};  ///< "20:00:00:00 instead of 10:00:04:13"
    std::string error{};       ///< of the disk, one line; empty: none
    int64_t position = 0;      ///< of the device, after the last block that was written
  };
  Counts counts() const;  ///< any thread

  /// Writes the blocks that the queue holds, gives the file the timecode of its first sample, syncs
  /// it and stops the thread. Empty when no block came. Only counts() and the destructor may be
  /// called afterwards.
  std::optional<take::SoundLedger> close();

 private:
  void process(const sound::SoundBlock& block);
  void append(const sound::SoundBlock& block);
  void count_jumps();
  void take_pulses();
  io::Status create_file(const sound::SoundBlock& first);
  io::Status write(const sound::SoundBlock& block, int64_t silence);
  io::Status write_silence(int64_t samples);
  /// The ledger's table of the file.
  take::SoundLedger describe() const;
  /// Fills the timecode without LTC: that of the output, or the time of day.
  void describe_generated(take::SoundLedger& ledger) const;

  const Setup setup_;
  std::filesystem::path path_;
  std::optional<sound::WaveWriter> file_;  ///< this and the next six: the thread, until close()
  std::optional<take::PeriodicSync> syncing_;
  sound::SoundTrack track_;
  io::Status written_;
  std::optional<capture::PulseEdge> first_pulse_, last_pulse_;
  mutable std::mutex mutex_;  ///< guards the next member
  Counts counts_;
  SoundReceiver receiver_;  ///< last member
};

/// The sound device of a node, which a thread opens and reads all the time: levels are known before
/// a take. After an error, and when no samples have come for two seconds, the device is opened
/// again every second.
class NodeSound {
 public:
  /// `wire`: socket of the simulated trigger, for a simulated device; empty: none. `timecode`: for
  /// takes without LTC in their sound.
  NodeSound(const StudioSound& sound, std::filesystem::path wire, TimecodeSource timecode = {});
  ~NodeSound();
  NodeSound(const NodeSound&) = delete;
  NodeSound& operator=(const NodeSound&) = delete;

  /// Records from now on. Call end() before the object is destroyed. One take at a time.
  void begin(const take::TakePaths& paths, const std::string& take, double pulse_rate_hz);
  /// Ends the recording, as SoundTake::close() does, with the samples until now: waits for them for
  /// half a second at most. Empty when begin() was not called.
  std::optional<take::SoundLedger> end();
  /// Listens for a clap from now on; records nothing. Not during a take. Call end_check() before
  /// the object is destroyed.
  void begin_check(double pulse_rate_hz);
  /// Ends the check, with the samples until now, as end(). Requires begin_check().
  CheckedSound end_check();
  /// Passes a pulse of the take or check on. Any thread.
  void pulse_at(const capture::PulseEdge& edge);

  struct Status {
    bool is_open = false;         ///< it delivers samples
    std::string fault;            ///< of the device, one line; empty: none
    std::vector<double> peaks{};  ///< of each channel since the last call, of full scale
    std::vector<sound::ChannelFault> level_faults{};  ///< of audible channels; none: not open
    SoundTake::Counts take{};                         ///< of the present take, else of the last one
    double waiting_s = 0;  ///< sound of the present take that is not written yet, seconds
  };
  Status status();

 private:
  void run();
  void read_device(sound::SoundInput& input);
  void deliver(sound::SoundBlock block);
  void set_fault(const std::string& fault);
  /// Waits for the samples until now, half a second at most, and ends the queue. `lock`: of mutex_.
  void end_queue(std::unique_lock<std::mutex>& lock);
  /// False when the thread has to end.
  bool wait(Duration duration);

  const StudioSound sound_;
  const std::filesystem::path wire_;
  const TimecodeSource timecode_;
  mutable std::mutex mutex_;  ///< guards the members below
  std::condition_variable changed_;
  bool stopping_ = false;
  bool is_open_ = false;
  std::string fault_;
  std::vector<double> peaks_;
  sound::LevelMonitor levels_;
  std::shared_ptr<SoundQueue> queue_;  ///< of the present take or check, else null
  std::shared_ptr<SoundTake> take_;    ///< the present one, else null
  std::shared_ptr<SoundCheck> check_;  ///< the present one, else null
  SoundTake::Counts last_take_;
  MonotonicInstant delivered_until_;  ///< time of the last block
  int64_t delivered_ = 0;             ///< position of the device after the last block
  int64_t position_ = 0, xruns_ = 0;  ///< of all earlier openings; the thread only
  std::atomic<double> stamp_uncertainty_s_ = 1e-3;
  std::thread thread_;  ///< last member
};

// Health and conditions of the sound devices of a capture node.

/// Adds sound_open_flag, sound_samples, sound_xruns, sound_peak_N_db, sound_channels_clipping and
/// sound_channels_silent and sound_timecode_jumps to the health. Reports faults of device and file,
/// lost samples, sound that waits for the disk, jumps of the timecode in the take, and each channel
/// that clips or is silent as conditions.
void report_sound(const NodeSound::Status& status, wire::HealthMessage& health,
                  bus::EventSender& events);

/// Adds timecode_output_open_flag and timecode_output_underruns to the health. Reports faults of
/// the device and underruns as conditions.
void report_timecode_output(const TimecodeOutput::Status& status, wire::HealthMessage& health,
                            bus::EventSender& events);

}  // namespace v3d::captured
