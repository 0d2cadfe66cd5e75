#include "take/take_transfer.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <set>

#include "base/core/error.h"
#include "base/core/text.h"
#include "base/core/time.h"
#include "base/io/file.h"
#include "take/joined_slate.h"
#include "take/ledger/ledger.h"
#include "take/ledger/take_account.h"
#include "take/ledger/take_signature.h"
#include "take/logs/frame_log.h"
#include "take/logs/log_files.h"
#include "take/logs/mesh_file.h"
#include "take/logs/repaired_pulses.h"
#include "take/take_listing.h"
#include "take/take_removal.h"

namespace v3d::take {
namespace {

namespace fs = std::filesystem;

struct Part {
  TakePaths paths;
  TakeInfo info;
  Ledger ledger;
};

/// Throws InputError for a symbolic link, whose target may be outside of the take.
void reject_link(const fs::path& path) {
  if (io::value_or_throw(io::entry_type_of(path)) == fs::file_type::symlink) {
    throw InputError(path.string() + ": it is a symbolic link");
  }
}

/// Creates a hard link `place` to `file`. Copies the file where hard links fail, for example across
/// file systems.
void link_or_copy(const fs::path& file, const fs::path& place) {
  reject_link(file);
  std::error_code error;
  fs::create_hard_link(file, place, error);
  if (error) io::throw_if_failed(io::copy_file(file, place));
}

void link_if_present(const fs::path& file, const fs::path& place) {
  if (file_exists(file) && !file_exists(place)) link_or_copy(file, place);
}

/// Links all segments of a log and their indexes (SegmentIndex).
void link_log(const fs::path& log, const fs::path& place) {
  for (const fs::path& segment : io::value_or_throw(existing_segments(log))) {
    const fs::path to = place.parent_path() / segment.filename();
    link_if_present(segment, to);
    link_if_present(segment_index_path(segment), segment_index_path(to));
  }
}

std::vector<Part> recorded_parts(const std::vector<TakePaths>& parts) {
  std::vector<Part> recorded;
  for (const TakePaths& paths : parts) {
    if (!file_exists(paths.info())) {
      if (may_hold_frames(paths)) {
        throw InputError(paths.folder.string() + ": has logs of cameras and no take.toml");
      }
      continue;  // of a node that only reconstructs
    }
    recorded.push_back({paths, load_take_info(paths), load_ledger(paths.ledger())});
  }
  if (recorded.empty()) throw InputError("no part of the take has a take.toml");
  return recorded;
}

void reject_other_take(const Part& first, const Part& other) {
  const std::string files = first.paths.folder.string() + " and " + other.paths.folder.string();
  if (first.info.name != other.info.name || first.info.rate_hz != other.info.rate_hz) {
    throw InputError(files + ": are parts of different takes: their names or rates differ");
  }
  if (read_take_text(first.paths.calib()) != read_take_text(other.paths.calib())) {
    throw InputError(files + ": have different calibrations (calib.toml)");
  }
}

std::string seconds_between(RealtimeInstant a, RealtimeInstant b) {
  const double ns = std::abs(static_cast<double>(to_ns(a)) - static_cast<double>(to_ns(b)));
  return format_count(std::llround(ns / 1e9));
}

/// When a pulse was, by the log of a part.
struct PulseTime {
  RealtimeInstant time;
  const Part* part = nullptr;
};

/// The times of pulses by their numbers. Every node logs those that the trigger's node has sent.
using PulseTimes = std::map<int64_t, PulseTime>;

/// Empty for a log that cannot be read: the verification of the joined take reports it.
PulseTimes times_of_pulses(const Part& part) {
  PulseTimes times;
  try {
    for (const wire::PulseMessage& message : read_pulses(part.paths.pulses())) {
      times.emplace(message.pulse, PulseTime{message.edge, &part});
    }
  } catch (const InputError&) {
    times.clear();
  }
  return times;
}

/// Throws InputError when `part` has pulses of `known`, and all at other times: a name that is used
/// again, for a take without the node that has the earlier one. Adds the pulses of `part` to
/// `known`.
void reject_other_pulses(const Part& part, PulseTimes& known) {
  PulseTimes times = times_of_pulses(part);
  std::optional<int64_t> differs;
  bool is_same = false;
  for (const auto& [pulse, here] : times) {
    const auto found = known.find(pulse);
    if (found == known.end()) continue;
    is_same = is_same || found->second.time == here.time;
    if (!differs) differs = pulse;
  }
  if (differs && !is_same) {
    const PulseTime& before = known.at(*differs);
    throw InputError(before.part->paths.folder.string() + " and " + part.paths.folder.string() +
                     ": are parts of different takes of one name: their pulses have other times, " +
                     "pulse " + format_count(*differs) + " differs by " +
                     seconds_between(before.time, times.at(*differs).time) + " s");
  }
  known.merge(times);
}

void link_folder(const fs::path& from, const fs::path& to) {
  reject_link(from);
  if (!file_exists(from)) return;
  io::throw_if_failed(io::create_folders(to));
  for (const fs::path& file : io::value_or_throw(io::list_folder(from))) {
    // files_not_joined() names folders and names that are not UTF-8.
    const bool is_folder = io::value_or_throw(io::entry_type_of(file)) == fs::file_type::directory;
    if (is_folder || !is_utf8(file.filename().native())) continue;
    link_if_present(file, to / file.filename());
  }
}

/// Links the files that are not specific to a camera: calibration, studio file, signatures, lists
/// of repaired pulses, plates, sound.
void link_shared_files(const TakePaths& part, const TakePaths& into) {
  link_if_present(part.calib(), into.calib());
  link_if_present(part.studio(), into.studio());
  for (const std::string& name : io::value_or_throw(take_file_names(part))) {
    if (!is_signature(name) && !is_repaired_pulses(name)) continue;
    link_if_present(part.folder / name, into.folder / name);
  }
  link_folder(part.background(), into.background());
  link_folder(part.sound(), into.sound());
}

/// Links tracked surfaces, those of earlier meshes and skeletons where there are none yet.
void link_motion(const TakePaths& part, const TakePaths& into) {
  link_if_present(part.motion(), into.motion());
  for (const std::string& name : io::value_or_throw(take_file_names(part))) {
    if (!is_skeleton(name) && !is_earlier_motion(name)) continue;
    link_if_present(part.folder / name, into.folder / name);
  }
}

void link_frames(const Part& part, const TakePaths& into, TakeInfo& info) {
  for (const std::string& camera : part.info.cameras) {
    if (std::find(info.cameras.begin(), info.cameras.end(), camera) != info.cameras.end()) {
      throw InputError(part.paths.folder.string() + ": another part has " + camera + " too");
    }
    info.cameras.push_back(camera);
    link_log(part.paths.frames(camera), into.frames(camera));
  }
}

/// The capture nodes of the take that no part comes from.
std::vector<TakeNode> absent_nodes(const std::vector<Part>& parts, const TakePaths& into,
                                   const std::vector<std::string>& cameras) {
  std::vector<TakeNode> nodes = capture_nodes(into);
  std::erase_if(nodes, [&](const TakeNode& node) {
    const bool has_part = std::ranges::any_of(
        parts, [&](const Part& part) { return part.paths.folder.filename() == node.name; });
    // A part may be a copy that was joined before.
    return has_part || std::ranges::find_first_of(cameras, node.cameras) != cameras.end() ||
           file_exists(signature_path(into, node.name));
  });
  return nodes;
}

/// Entries of the joined ledger for all files of `into`. The entries of the pulse log come from
/// `of_pulses`, the ledger of the part whose pulse log is used.
std::vector<TakeFile> joined_files(const std::vector<Part>& parts, const Ledger& of_pulses,
                                   const TakePaths& into) {
  std::vector<TakeFile> files;
  for (const std::string& name : io::value_or_throw(take_file_names(into))) {
    const bool is_of_pulses = is_of_log(name, into.pulses());
    const TakeFile* entry = is_of_pulses ? of_pulses.file(name) : nullptr;
    for (auto part = parts.begin(); !entry && !is_of_pulses && part != parts.end(); ++part) {
      entry = part->ledger.file(name);
    }
    if (entry) files.push_back(*entry);
  }
  return files;
}

}  // namespace

MeshPart part_with_most_meshes(const std::vector<TakePaths>& parts) {
  MeshPart best;
  std::optional<size_t> max_meshes;
  for (const TakePaths& part : parts) {
    if (!file_exists(part.mesh())) continue;
    try {
      const size_t meshes = MeshFileReader(part.mesh()).pulses().size();
      if (max_meshes && meshes <= *max_meshes) continue;
      best.part = &part;
      max_meshes = meshes;
    } catch (const InputError& error) {
      best.errors.emplace_back(error.what());
      if (!best.part) best.part = &part;
    }
  }
  return best;
}

TakeInfo join_parts(const std::vector<TakePaths>& parts, const TakePaths& into) {
  const std::vector<Part> recorded = recorded_parts(parts);
  TakeInfo info = recorded.front().info;
  info.cameras.clear();
  io::throw_if_failed(io::create_folders(into.background()));
  std::vector<Ledger> ledgers;
  PulseTimes times;
  for (const Part& part : recorded) {
    reject_other_take(recorded.front(), part);
    reject_other_pulses(part, times);
    link_frames(part, into, info);
    info.started = std::min(info.started, part.info.started);
    if (part.info.state != TakeState::kComplete) info.state = part.info.state;
    ledgers.push_back(part.ledger);
  }
  for (const TakePaths& part : parts) link_shared_files(part, into);
  io::throw_if_failed(join_slates(parts, into));
  if (const TakePaths* meshes = part_with_most_meshes(parts).part) {
    link_if_present(meshes->mesh(), into.mesh());
    link_if_present(meshes->proxy(), into.proxy());
    link_motion(*meshes, into);
  }
  for (const TakePaths& part : parts) link_motion(part, into);
  const auto sensed_most = std::max_element(
      recorded.begin(), recorded.end(),
      [](const Part& a, const Part& b) { return a.ledger.sensed < b.ledger.sensed; });
  link_log(sensed_most->paths.pulses(), into.pulses());
  Ledger ledger = merge(ledgers);
  ledger.absent_nodes = absent_nodes(recorded, into, info.cameras);
  ledger.files = joined_files(recorded, sensed_most->ledger, into);
  info.pulses = ledger.commanded;
  save_account_or_throw(into, info, std::move(ledger));
  return info;
}

std::vector<std::string> files_not_joined(const std::vector<TakePaths>& parts,
                                          const TakePaths& whole) {
  std::vector<std::string> files;
  for (const TakePaths& part : parts) {
    for (const std::string& name : io::value_or_throw(take_file_names(part))) {
      const bool is_of_program = is_written_after_ledger(name) || is_of_log(name, part.pulses());
      if (is_of_program || file_exists(whole.folder / name)) continue;
      files.push_back((part.folder.filename() / name).string());
    }
    for (const std::string& name : io::value_or_throw(foreign_entries(part))) {
      files.push_back(printable((part.folder.filename() / name).string()));
    }
  }
  std::ranges::sort(files);
  return files;
}

namespace {

std::set<int64_t> pulses_in(const TakePaths& take) {
  std::set<int64_t> pulses;
  for (const wire::PulseMessage& message : read_pulses(take.pulses())) pulses.insert(message.pulse);
  return pulses;
}

/// Pulses with an undamaged mesh in a mesh file. Throws InputError when a mesh cannot be read from
/// the disk.
std::set<int64_t> meshes_in(const fs::path& path) {
  MeshFileReader meshes(path);
  std::set<int64_t> pulses;
  for (const int64_t pulse : meshes.pulses()) {
    if (io::value_or_throw(meshes.read(pulse))) pulses.insert(pulse);
  }
  return pulses;
}

class CopyCheck {
 public:
  CopyCheck(const TakePaths& original, const TakePaths& copy) : original_(original), copy_(copy) {}

  std::vector<std::string> run(const Verified& verified) {
    // A copy by other programs (cp -r) may be in memory only: files, and the names in its folders.
    if (const auto synced = io::sync_file_system(copy_.folder); !synced) {
      io::throw_input_error(synced.error());
    }
    load_from_disk(copy_.info());
    check_info();
    check_ledger();
    check_slate();
    std::vector<TakeFile> pulse_log;
    for (const TakeFile& file : verified.files) {
      const bool is_joined = file.name == original_.info().filename() ||
                             file.name == original_.ledger().filename() ||
                             file.name == original_.slate().filename();
      if (is_of_log(file.name, original_.pulses())) {
        pulse_log.push_back(file);
      } else if (!is_joined) {
        check_file(file);
      }
    }
    check_pulse_log(pulse_log);
    return std::move(lines_);
  }

 private:
  /// Reads a file of the copy past the page cache, which then has the bytes of the disk. Throws
  /// InputError.
  void load_from_disk(const fs::path& file) const {
    io::value_or_throw(read_take_file(copy_, file.filename(), ReadFrom::kDisk));
  }

  void check_info() {
    const TakeInfo original = load_take_info(original_), copy = load_take_info(copy_);
    if (copy.name != original.name) {
      lines_.push_back(copy_.folder.string() + ": is a copy of take " + copy.name + ", not of " +
                       original.name);
    }
    if (copy.state == TakeState::kRecording) {
      lines_.push_back(copy_.folder.string() + ": the take was not closed");
    }
    for (const std::string& camera : original.cameras) {
      if (std::ranges::find(copy.cameras, camera) != copy.cameras.end()) continue;
      lines_.push_back(copy_.info().string() + ": has no camera '" + camera + "'");
    }
  }

  void check_ledger() {
    try {
      load_from_disk(copy_.ledger());
      const Ledger copy = load_ledger(copy_.ledger());
      Ledger counted_to;  // the joined take may have more pulses than the node counted
      counted_to.commanded = copy.commanded;
      for (const CameraLedger& camera :
           merge({load_ledger(original_.ledger()), counted_to}).cameras) {
        if (std::ranges::find(copy.cameras, camera) != copy.cameras.end()) continue;
        lines_.push_back(copy_.ledger().string() + ": has another account of " + camera.name +
                         " than the original");
      }
    } catch (const InputError& error) {
      lines_.emplace_back(error.what());
    }
  }

  /// The crew edits slates, so their content may differ.
  void check_slate() {
    if (!file_exists(original_.slate()) && !file_exists(copy_.slate())) return;
    try {
      load_from_disk(copy_.slate());
      load_slate(copy_.slate());
    } catch (const InputError& error) {
      lines_.emplace_back(error.what());
    }
  }

  /// Reports a file of the copy that is the file of the original.
  bool is_the_file_itself(const std::string& name) {
    const fs::path path = copy_.folder / name;
    std::error_code error;
    if (!fs::equivalent(original_.folder / name, path, error)) return false;
    lines_.push_back(path.string() + ": is the file itself, not a copy");
    return true;
  }

  /// Compares the segments of the pulse log as one log, because a joined take has the segments of
  /// one node. `files`: those of the original, with the indexes of a recovery.
  void check_pulse_log(const std::vector<TakeFile>& files) {
    for (const TakeFile& file : files) {
      if (is_the_file_itself(file.name)) return;
    }
    const bool are_equal = std::ranges::all_of(files, [&](const TakeFile& file) {
      const auto read = read_take_file(copy_, file.name, ReadFrom::kDisk);
      return read && read->checksum == file.checksum;
    });
    if (are_equal) return;
    try {
      const auto segments = io::value_or_throw(existing_segments(copy_.pulses()));
      for (const fs::path& segment : segments) load_from_disk(segment);
      if (std::ranges::includes(pulses_in(copy_), pulses_in(original_))) return;
      lines_.push_back(copy_.pulses().string() + ": lacks pulses of the original");
    } catch (const InputError& error) {
      lines_.emplace_back(error.what());
    }
  }

  void check_file(const TakeFile& file) {
    const fs::path path = copy_.folder / file.name;
    if (is_the_file_itself(file.name)) return;
    const auto read = read_take_file(copy_, file.name, ReadFrom::kDisk);
    if (!read) {
      lines_.push_back(read.error().message);
    } else if (read->checksum != file.checksum && !may_differ(file.name)) {
      lines_.push_back(path.string() + ": has " + format_count(read->bytes) +
                       " bytes with the checksum " + checksum_text(*read->checksum) +
                       ", the original " + format_count(file.bytes) + " with " +
                       checksum_text(*file.checksum));
    }
  }

  /// True for the file of another node that contains every mesh of the original, and for a
  /// skeleton, which commands replace. Reports a file that cannot be read.
  bool may_differ(const std::string& name) {
    if (is_skeleton(name)) return true;
    try {
      return (name == original_.mesh().filename() || name == original_.proxy().filename()) &&
             std::ranges::includes(meshes_in(copy_.folder / name),
                                   meshes_in(original_.folder / name));
    } catch (const InputError& error) {
      lines_.emplace_back(error.what());
      return false;
    }
  }

  const TakePaths& original_;
  const TakePaths& copy_;
  std::vector<std::string> lines_;
};

}  // namespace

std::vector<std::string> missing_in_copy(const TakePaths& original, const Verified& verified,
                                         const TakePaths& copy) {
  return CopyCheck(original, copy).run(verified);
}

}  // namespace v3d::take
