// A reconstruction in pieces: what lies on the disk until they are joined.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "v3dctl/reconstruct/reconstruct_report.h"
#include "v3dctl/reconstruct/reconstruct_request.h"

namespace v3d::ctl {

/// The pulses between two places where a key frame must stand: reconstructed by themselves they are
/// the same as in the whole, to the byte.
struct Piece {
  int64_t number = 0;           ///< counted from pulse 0, whatever pulses the take has
  std::vector<int64_t> pulses;  ///< rising
};

/// Of rising pulses.
std::vector<Piece> pieces_of(const std::vector<int64_t>& pulses);

/// TAKE/.pieces-DIGEST:
///   order.json          everything that the result depends on; of this the name is a digest
///   piece-000012.v3d    the meshes of a finished piece
///   piece-000012.json   what is told of it, and a checksum of both
///   refused-*           why no other try would help, one line
///   task-*.log          what tasks said on stderr
/// So pieces are only ever joined with those of the same take, options and program. Files come into
/// being whole. Several processes, also on several hosts, may work in one folder.
class PieceFolder {
 public:
  /// Makes the folder for a settled request where it is not there. Throws std::runtime_error when
  /// the disk refuses.
  static PieceFolder of(const ReconstructRequest& settled, const TakeFrames& take);
  /// One that is there.
  explicit PieceFolder(std::filesystem::path path) : path_(std::move(path)) {}

  const std::filesystem::path& path() const { return path_; }
  std::string digest() const;

  /// The settled request. Throws InputError where this program is not the one that ordered it.
  ReconstructRequest order() const;

  std::filesystem::path mesh(const Piece& piece) const;
  /// Behind its mesh file. Throws std::runtime_error when the disk refuses.
  void save(const Piece& piece, const ReconstructReport& report) const;
  /// What was told of the piece, where it is finished and whole. `begun`: begin_report() of the
  /// request.
  std::optional<ReconstructReport> find(const Piece& piece, const ReconstructReport& begun) const;
  /// As if it had never been made.
  void drop(const Piece& piece) const;
  /// The numbers of pieces that seem finished, which costs a look at the folder.
  std::set<int64_t> saved() const;

  /// For whoever waits for the pieces.
  void refuse(const std::string& reason) const;
  std::optional<std::string> refusal() const;
  /// Those of an earlier run.
  void forget_refusals() const;

  void remove() const;
  /// Removes what runs with other options left behind. A folder stays unless its lock could be
  /// taken: a process may still work in it.
  void remove_others() const;

 private:
  std::filesystem::path report(const Piece& piece) const;

  std::filesystem::path path_;
};

/// The lock of a folder of pieces (flock(2) on its file `lock`), held until destruction. One
/// process at a time waits for the pieces of a folder.
class PieceFolderLock {
 public:
  enum class State {
    kHeld,           ///< by this object
    kHeldByAnother,  ///< by another process or object
    kUnknown,        ///< the file could not be opened, or its disk has no locks
  };

  explicit PieceFolderLock(const PieceFolder& folder);
  ~PieceFolderLock();
  PieceFolderLock(const PieceFolderLock&) = delete;
  PieceFolderLock& operator=(const PieceFolderLock&) = delete;

  State state() const { return state_; }
  /// Path and cause if the file could not be opened; else empty.
  const std::string& error() const { return error_; }

 private:
  int fd_ = -1;
  State state_ = State::kUnknown;
  std::string error_;
};

}  // namespace v3d::ctl
