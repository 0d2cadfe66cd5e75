// Ledger, sets and counts of pulses.
#pragma once

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "base/io/file.h"
#include "take/ledger/sound_ledger.h"
#include "take/take.h"
#include "take/take_files.h"

namespace v3d::take {

// PulseSet: a compact set of the pulse numbers of a take.

/// A set of pulse numbers, stored as runs of consecutive numbers: memory depends on the number of
/// gaps, not on the length of the take. Accepts any number. One thread.
class PulseSet {
 public:
  /// Returns false when the set already contains `pulse`.
  bool insert(int64_t pulse);
  bool contains(int64_t pulse) const;
  int64_t size() const { return size_; }
  /// The highest number; -1 when the set is empty.
  int64_t last() const { return runs_.empty() ? -1 : runs_.rbegin()->second; }
  /// All numbers, ascending.
  std::vector<int64_t> all() const;
  /// Numbers of [0, commanded) that the set does not contain, ascending.
  std::vector<int64_t> missing(int64_t commanded) const;
  /// Numbers of the set outside of [0, commanded), ascending.
  std::vector<int64_t> outside(int64_t commanded) const;

 private:
  std::map<int64_t, int64_t> runs_;  ///< first to last number of a run
  int64_t size_ = 0;
};

// The ledger: the account of pulses and frames of a take.

struct CameraLedger {
  std::string name;
  int64_t exposed = 0;           ///< frames exposed, by the camera's frame counter (ExposureCount)
  int64_t received = 0;          ///< complete frames that the host received
  int64_t written = 0;           ///< frames in <camera>.lcmlog
  int64_t published = 0;         ///< frames sent live
  std::vector<int64_t> missing;  ///< pulses without a frame
  std::vector<int64_t> duplicate;  ///< pulses with more than one frame
  std::vector<int64_t> suspect;    ///< pulses whose frame may have a wrong number

  friend bool operator==(const CameraLedger&, const CameraLedger&) = default;
};

struct Ledger {
  std::string take;
  int64_t commanded = 0;
  /// True when `commanded` is a lower bound: the node recovered the take, left it before its end,
  /// or did not receive its end.
  bool commanded_is_minimum = false;
  std::optional<int64_t> sensed;  ///< pulses that the sense line detected; empty: no sense line
  std::vector<int64_t> unsensed = {};  ///< commanded pulses that it did not detect
  int64_t extra = 0;                   ///< pulses that it detected besides those of the train
  std::vector<int64_t> runt = {};      ///< pulses that it detected as too short
  std::vector<CameraLedger> cameras;
  std::vector<SoundLedger> sounds = {};  ///< does not decide whether the take is complete
  /// Nodes with a sound device of which nothing was recorded. Not in ledger.toml, so that earlier
  /// versions read it: verify_take() finds them by the studio file of the take.
  std::vector<std::string> nodes_without_sound = {};
  /// Of a collected take: its capture nodes that are not in this copy, because the operator left
  /// them out.
  std::vector<TakeNode> absent_nodes = {};
  /// The files of the take, except those of is_written_after_ledger(). Empty in ledgers of versions
  /// before 2026-11-25, which had no list. A camera log that a recovery found has no checksum.
  std::vector<TakeFile> files = {};

  /// True when the number of pulses is known, all pulses were sensed (if the studio has a sense
  /// line), no other pulses were, each camera has exactly one unsuspected frame of each pulse, and
  /// no node is absent.
  bool complete() const;
  /// The result in one line: "take kendo-07: complete, 15 cameras x 1,250 pulses, 0 missing, 0
  /// suspect".
  std::string verdict() const;
  /// The entry of the file `name`; null when the ledger does not list it.
  const TakeFile* file(std::string_view name) const;
};

/// Builds the ledger of one camera from its frame labels, one frame at a time. Stores only
/// exceptions (gaps, duplicates, suspect frames), because a take may last hours.
class CameraAccount {
 public:
  /// Adds the label of the next frame.
  void add(int64_t pulse, bool suspect);
  /// The ledger of all added frames. A frame whose pulse is not in [0, commanded) is suspect.
  /// `received`, `exposed` and `written` are the number of added frames.
  CameraLedger ledger(const std::string& camera, int64_t commanded) const;

 private:
  PulseSet seen_;
  std::set<int64_t> duplicate_;
  std::set<int64_t> suspect_;
  int64_t frames_ = 0;
};

/// The ledger of one camera. `pulses`: the pulse of every frame in order of arrival; `suspect`:
/// pulses of suspect frames.
CameraLedger account(const std::string& camera, const std::vector<int64_t>& pulses,
                     const std::vector<int64_t>& suspect, int64_t commanded);

/// Merges the ledgers of all nodes of a take: the cameras of all nodes, and the pulses of the node
/// that sensed the most. Extra and runt pulses are those of all nodes: only the node with the sense
/// line counts them, and other nodes report as many sensed pulses. The number of pulses is a
/// minimum only when it is one in each of the parts that have the highest number. If a camera's
/// node counted fewer pulses, the remaining pulses are missing for that camera, except those with a
/// suspect frame.
Ledger merge(const std::vector<Ledger>& parts);

/// Formats ascending numbers, neighbours and regular ones as ranges: "3-17, 20, 30-98 by 2". After
/// 24 ranges, for a terminal: ", ... (108,000 in all; --json lists them)".
std::string number_ranges(const std::vector<int64_t>& numbers);
/// The absent nodes, the missing and runt pulses of the sense line, the missing, duplicate and
/// suspect pulses of each camera, and the problems of the sound, one line each. Empty when the
/// ledger has none.
std::vector<std::string> problem_lines(const Ledger& ledger);
/// Exposed, received, written and published frames of each camera, as a text table.
std::vector<std::string> table_lines(const Ledger& ledger);

/// Maximum length of ledger.toml, bytes. The longest lists many pulses of hours, without any
/// regularity, as missing for each camera of a large studio: 50 MB.
inline constexpr uint64_t kMaxLedgerBytes = 64 << 20;

/// Reads ledger.toml, whose first line has the checksum (XXH3) of all following bytes. Ledgers of
/// versions before 2026-11-25 have no such line. Throws InputError with file, line and field, also
/// when the file is missing, damaged or longer than kMaxLedgerBytes.
Ledger load_ledger(const std::filesystem::path& path);
Ledger parse_ledger(std::string_view text, const std::filesystem::path& path);
/// Writes ledger.toml with its checksum, with io::replace_file(). Fails with EFBIG, and keeps the
/// earlier file, when load_ledger() would reject the new one as too long.
[[nodiscard]] io::Status save_ledger(const std::filesystem::path& path, const Ledger& ledger);

// Number of frames that a camera exposed, derived from its frame counter.

/// Counts exposed frames, including frames that were lost on the way to the host.
///
/// A lost frame leaves a gap in the camera's counter; a restart of the camera resets the counter.
/// The count is the number of counter values from the first to the last received frame, summed over
/// all runs of the camera. Frames may arrive out of order by up to 4 counter values; a gap of
/// 100,000 or more counts as a restart.
class ExposureCount {
 public:
  /// Adds the next received frame. `counter`: its frame counter.
  void add(uint64_t counter) {
    const bool continues =
        frames_ > 0 && counter + kOutOfOrder >= last_ && counter < last_ + kMaxLost;
    if (!continues) {
      earlier_runs_ += span();
      first_ = last_ = counter;
      frames_ = 0;
    }
    first_ = std::min(first_, counter);
    last_ = std::max(last_, counter);
    ++frames_;
  }
  int64_t exposed() const { return earlier_runs_ + span(); }

 private:
  static constexpr uint64_t kOutOfOrder = 4;
  static constexpr uint64_t kMaxLost = 100'000;

  int64_t span() const { return frames_ == 0 ? 0 : static_cast<int64_t>(last_ - first_) + 1; }

  int64_t earlier_runs_ = 0;
  int64_t frames_ = 0;
  uint64_t first_ = 0, last_ = 0;
};

}  // namespace v3d::take
