// The ledger: the account of pulses and frames of a take.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "base/io/result.h"
#include "take/ledger/pulse_set.h"
#include "take/take_files.h"

namespace v3d {

struct CameraLedger {
  std::string name;
  int64_t exposed = 0;    ///< frames by the camera's own count, first to last (ExposureCount)
  int64_t received = 0;   ///< frames that reached the host whole
  int64_t written = 0;    ///< frames in <camera>.lcmlog
  int64_t published = 0;  ///< frames sent live
  std::vector<int64_t> missing;    ///< pulses without a frame
  std::vector<int64_t> duplicate;  ///< pulses with more than one
  std::vector<int64_t> suspect;    ///< pulses whose label is in doubt
};

struct Ledger {
  std::string take;
  int64_t commanded = 0;
  std::optional<int64_t> sensed;       ///< pulses that the sense line saw; empty: there is none
  std::vector<int64_t> unsensed = {};  ///< pulses that were commanded, and that it did not see
  int64_t extra = 0;                   ///< pulses that it saw between those of the train
  std::vector<int64_t> runt = {};      ///< pulses that it saw too short
  std::vector<CameraLedger> cameras;
  /// The files of the take, but for those of is_written_after_ledger(). Empty in ledgers of
  /// versions before 2026-12, which had no list. A log without a checksum is one that a recovery
  /// found.
  std::vector<TakeFile> files = {};

  /// Every pulse sensed, where there is a sense line, and nothing else; every frame written.
  bool complete() const;
  /// "take kendo-07: complete, 15 cameras x 1,250 pulses, 0 missing, 0 suspect"
  std::string verdict() const;
  /// The file of this name; null where the ledger does not name it.
  const TakeFile* file(std::string_view name) const;
};

/// What a camera's frames make of its ledger, one after the other. Takes memory for what is wrong
/// only: a take may last hours.
class CameraAccount {
 public:
  /// The next frame's label.
  void add(int64_t pulse, bool suspect);
  /// A frame of a pulse that was never commanded has no right label, and is suspect. `received` and
  /// `exposed` are as many as were added.
  CameraLedger ledger(const std::string& camera, int64_t commanded) const;

 private:
  PulseSet seen_;
  std::set<int64_t> duplicate_;
  std::set<int64_t> suspect_;
  int64_t frames_ = 0;
};

/// The same of all frames at once. `pulses`: of every frame in order of arrival; `suspect`: those
/// in doubt.
CameraLedger account(const std::string& camera, const std::vector<int64_t>& pulses,
                     const std::vector<int64_t>& suspect, int64_t commanded);

/// The account of a whole take from those of its nodes: cameras side by side; the pulses by the
/// node that counts most. A camera whose node counted fewer pulses misses the rest of them, but for
/// those of which it has a frame: these stay suspect.
Ledger merge(const std::vector<Ledger>& parts);

/// "3-17, 20": numbers that rise, neighbours as a range.
std::string number_ranges(const std::vector<int64_t>& numbers);
/// Per camera what is missing, duplicate or suspect, by name; one line each. Nothing when all is
/// well.
std::vector<std::string> trouble_lines(const Ledger& ledger);
/// What each camera exposed, received, wrote and published, as a table.
std::vector<std::string> table_lines(const Ledger& ledger);

/// Throws InputError with file, line and field; also when the file is not there, and when it is
/// damaged. Its first line has the checksum (XXH3) of all bytes behind that line. Ledgers of
/// versions before 2026-12 have no such line.
Ledger load_ledger(const std::filesystem::path& path);
Ledger parse_ledger(std::string_view text, const std::filesystem::path& path);
/// io::replace_file() of ledger.toml, with its checksum.
[[nodiscard]] io::Status save_ledger(const std::filesystem::path& path, const Ledger& ledger);

}  // namespace v3d
