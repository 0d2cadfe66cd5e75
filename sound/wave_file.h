// Broadcast Wave files: writer and reader. The adapter of libsndfile.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/core/time.h"
#include "base/io/file.h"
#include "sound/wave_timecode.h"

namespace v3d::sound {

// A *sample* is one instant of all channels; its position counts from 0 at the start of the file.
// Values are interleaved: channel c of sample s is at index s * channels + c. A value uses the full
// range of int32_t; a file stores its upper 24 bits.

inline constexpr int kMinRateHz = 8'000;
inline constexpr int kMaxRateHz = 192'000;
inline constexpr int kMaxChannels = 64;

struct WaveFormat {
  int rate_hz = 48'000;
  int channels = 2;
  friend bool operator==(const WaveFormat&, const WaveFormat&) = default;
};

/// The origin of a recording: the fields of the chunk `bext` of a Broadcast Wave file, and two of
/// its chunk `iXML` (sound/wave_timecode.h). Source: EBU Tech 3285, version 2.
struct WaveOrigin {
  std::string description;  ///< at most 256 bytes
  std::string originator;   ///< at most 32 bytes
  std::string date;         ///< of the first sample, local time: "2026-11-27"
  std::string time;         ///< "15:04:05"
  /// Time reference: local time of the first sample, or its timecode where `timecode_rate` is set.
  int64_t samples_since_midnight = 0;
  std::optional<RealtimeInstant> first_sample = {};  ///< wall-clock time
  std::optional<TimecodeRate> timecode_rate = {};
  friend bool operator==(const WaveOrigin&, const WaveOrigin&) = default;
};

/// The origin of a file whose first sample was recorded at `first_sample`, in the local time zone
/// of this process.
WaveOrigin wave_origin(RealtimeInstant first_sample, int rate_hz, std::string description,
                       std::string originator);
/// The inverse: the time of the first sample. Files of earlier versions have no `first_sample`: the
/// date and the time reference then count, in the local time zone of this process. Empty where the
/// origin has no date that can be read.
std::optional<RealtimeInstant> first_sample_time(const WaveOrigin& origin, int rate_hz);

/// Writes a growing file of 24-bit PCM: RIFF up to 4 GiB, RF64 above.
///
/// The header states the length after every write. After the process is killed, the file is thus
/// readable up to the last write() that returned. After a power cut, it is readable up to the last
/// sync of file(). One thread.
class WaveWriter {
 public:
  /// Creates the file. Fails with path and cause, also when the name is taken.
  /// Requires a rate of kMinRateHz to kMaxRateHz, and 1 to kMaxChannels channels.
  [[nodiscard]] static io::Result<WaveWriter> create(const std::filesystem::path& path,
                                                     const WaveFormat& format,
                                                     const WaveOrigin& origin);
  WaveWriter(WaveWriter&&) noexcept;
  WaveWriter& operator=(WaveWriter&&) noexcept;
  ~WaveWriter();

  /// Appends samples. Requires a multiple of the channels. Fails with path and cause; the file then
  /// ends at an earlier sample, and later calls fail with the same error.
  [[nodiscard]] io::Status write(std::span<const int32_t> values);
  /// Ends the file. Its time reference becomes `timecode`, and `iXML` states the rate; empty: they
  /// stay as created. The length of the file does not change, and it is readable at every moment.
  /// Only samples() and file() may be called afterwards. Fails with path and cause; the samples are
  /// then as before.
  [[nodiscard]] io::Status finish(const std::optional<WaveTimecode>& timecode);
  /// The number of samples that were written.
  int64_t samples() const;
  /// The open file, to sync it. Another thread may sync it during write().
  const io::File& file() const;

 private:
  struct Impl;
  explicit WaveWriter(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

/// Reads a RIFF or RF64 file of 16, 24 or 32-bit PCM. One thread.
class WaveReader {
 public:
  /// Opens the file. Fails with path and cause; the cause of a file of another kind names the kind
  /// that was expected. A file that is shorter than its header states ends at its last whole
  /// sample.
  [[nodiscard]] static io::Result<WaveReader> open(const std::filesystem::path& path);
  /// Like open(), for bytes in memory. `name` is the path in errors.
  [[nodiscard]] static io::Result<WaveReader> parse(std::vector<uint8_t> bytes,
                                                    const std::filesystem::path& name);
  WaveReader(WaveReader&&) noexcept;
  WaveReader& operator=(WaveReader&&) noexcept;
  ~WaveReader();

  const WaveFormat& format() const;
  /// The number of samples.
  int64_t samples() const;
  /// Empty fields where the file has no chunk `bext`.
  const WaveOrigin& origin() const;

  /// Reads `count` samples from `first` on; fewer at the end of the file. Fails with path and
  /// cause.
  [[nodiscard]] io::Result<std::vector<int32_t>> read(int64_t first, int64_t count);

 private:
  struct Impl;
  explicit WaveReader(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace v3d::sound
