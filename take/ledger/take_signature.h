// Signatures of takes over hash trees of files.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "base/core/time.h"
#include "base/io/file.h"
#include "take/ledger/ledger.h"
#include "take/logs/file_hashes.h"
#include "take/take.h"
#include "take/take_files.h"
#include "wire/signatures.h"

namespace v3d::take {

// Hash trees over the files of a take.

/// Reads a file of a take and computes the root of its hash tree (add_to_tree()).
///
/// `bytes`: the expected length. A file of another length is not read, and the result has no root.
/// Fails as add_to_tree() does, also when the name is a symbolic link.
[[nodiscard]] io::Result<TakeFile> hash_take_file(const TakePaths& paths, const std::string& name,
                                                  int64_t bytes,
                                                  const MayContinue& may_continue = {});

// Digital signatures of takes (signature.<node>.toml).
//
// When a node closes a take, it writes the capture nodes of the take, its own counts of frames and
// the hash tree roots of the files that it recorded, and signs them
// with its Ed25519 key. docs/takes.md describes the format; take/ledger/signature_check.h verifies
// signatures.

/// A camera that the signing node recorded, with the counts of its ledger (CameraLedger).
struct SignedCamera {
  std::string name;
  int64_t exposed = 0;
  int64_t received = 0;
  int64_t written = 0;
  int64_t published = 0;
  friend bool operator==(const SignedCamera&, const SignedCamera&) = default;
};
SignedCamera signed_counts(const CameraLedger& camera);

/// When a take was signed. A signature of the stop covers what the node wrote. Those made later
/// cover what the disk had then.
enum class SigningOccasion : uint8_t {
  kUnknown,   ///< a signature of an older format
  kStop,      ///< by the node, when it closed the take
  kRecovery,  ///< by the node, after a recovery had closed the take
  kCommand    ///< by v3dctl takes sign
};
/// "stop", "recovery", "command"; "unknown" for kUnknown.
std::string_view name(SigningOccasion occasion);

/// The content of signature.<node>.toml.
struct TakeSignature {
  /// The first format with `nodes` and `cameras`. Without them, the removal of everything that a
  /// node recorded is not noticed.
  static constexpr int64_t kNodesFormat = 2;
  /// The first format with `occasion`.
  static constexpr int64_t kOccasionFormat = 3;

  int64_t format = kOccasionFormat;
  std::string take;
  std::string studio;
  std::string node;
  wire::PublicKey key;
  RealtimeInstant started;
  RealtimeInstant signed_at;
  SigningOccasion occasion = SigningOccasion::kUnknown;
  double rate_hz = 0;
  int64_t pulses = 0;
  TakeState state = TakeState::kComplete;
  std::vector<TakeNode> nodes;  ///< capture_nodes()
  std::vector<SignedCamera> cameras;
  /// All files of the node for which is_signed_file() is true. For a file without a root, only the
  /// length is signed: a camera log that was recorded before a restart of the daemon.
  std::vector<TakeFile> files;

  bool names_nodes() const { return format >= kNodesFormat; }
};

/// The path of signature.<node>.toml.
std::filesystem::path signature_path(const TakePaths& paths, const std::string& node);

/// Renames the signature of `node`, if there is one, to a hidden name, before the node continues
/// the take. The signature does not cover the continued take; after a crash it would otherwise
/// remain as its only signature. Returns whether there was one. Replaces an earlier file of the
/// hidden name. Fails with path and cause.
[[nodiscard]] io::Result<bool> set_signature_aside(const TakePaths& paths, const std::string& node);
/// Undoes set_signature_aside(). Fails with path and cause.
[[nodiscard]] io::Status restore_signature(const TakePaths& paths, const std::string& node);

/// A node and its signing key.
struct TakeSigner {
  std::string node;
  wire::SigningKey key;
};

/// True when signatures cover the file: every file that is written before the ledger, except
/// take.toml. The signature itself contains the fields of take.toml.
bool is_signed_file(std::string_view name);

/// Signs a take that was just closed as `signer` (SigningOccasion::kStop), and replaces an earlier
/// signature of this node.
///
/// `files`: entries with known roots, for example from EventLogWriter::file(). Other files are
/// read, except camera logs; sound of an hour takes many seconds. Requires the ledger. Fails with
/// path and cause, and with ECANCELED when `may_continue` returned false; throws nothing that a
/// disk or a damaged file causes.
[[nodiscard]] io::Status sign_take(const TakePaths& paths, const TakeSigner& signer,
                                   const std::vector<TakeFile>& files,
                                   const MayContinue& may_continue = {});

/// Reads all files of a closed take, camera logs included, and makes the signature that
/// save_signature() writes. Fails with path and cause; with ECANCELED when `may_continue` returned
/// false.
[[nodiscard]] io::Result<TakeSignature> read_signature(const TakePaths& paths,
                                                       const TakeSigner& signer,
                                                       SigningOccasion occasion,
                                                       const MayContinue& may_continue = {});
/// read_signature() and save_signature().
[[nodiscard]] io::Status sign_whole_take(const TakePaths& paths, const TakeSigner& signer,
                                         SigningOccasion occasion);

/// Signs `signature` with `key`, and replaces signature.<node>.toml. Fails with path and cause.
[[nodiscard]] io::Status save_signature(const TakePaths& paths, const TakeSignature& signature,
                                        const wire::SigningKey& key);

/// Parses signature.<node>.toml. Throws InputError with file, line and field, also when the
/// signature does not match the text under the public key in the text.
TakeSignature parse_signature(std::string_view text, const std::filesystem::path& path);

}  // namespace v3d::take
