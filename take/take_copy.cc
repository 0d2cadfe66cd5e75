#include "take/take_copy.h"

#include <algorithm>
#include <set>

#include "base/core/error.h"
#include "base/core/units.h"
#include "base/io/file.h"
#include "base/io/whole_file.h"
#include "take/ledger/ledger.h"
#include "take/logs/frame_log.h"
#include "take/logs/mesh_file.h"
#include "take/slate.h"

namespace v3d {
namespace {

namespace fs = std::filesystem;

std::set<int64_t> pulses_in(const TakePaths& take) {
  std::set<int64_t> pulses;
  for (const PulseMessage& message : read_pulses(take.pulses())) pulses.insert(message.pulse);
  return pulses;
}

/// Pulses with an undamaged mesh. Throws InputError when a mesh cannot be read from the disk.
std::set<int64_t> meshes_in(const TakePaths& take) {
  MeshFileReader meshes(take.mesh());
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
    for (const TakeFile& file : verified.files) {
      const bool is_joined = file.name == original_.info().filename() ||
                             file.name == original_.ledger().filename() ||
                             file.name == original_.slate().filename();
      if (!is_joined) check_file(file);
    }
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

  void check_file(const TakeFile& file) {
    const fs::path path = copy_.folder / file.name;
    std::error_code error;
    if (fs::equivalent(original_.folder / file.name, path, error)) {
      lines_.push_back(path.string() + ": is the file itself, not a copy");
      return;
    }
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

  /// True for the file of another node that contains every pulse or mesh of the original.
  /// Reports a file that cannot be read.
  bool may_differ(const std::string& name) {
    try {
      if (name == original_.pulses().filename()) {
        return std::ranges::includes(pulses_in(copy_), pulses_in(original_));
      }
      return name == original_.mesh().filename() &&
             std::ranges::includes(meshes_in(copy_), meshes_in(original_));
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

}  // namespace v3d
