// Digital signatures of takes (signature.<node>.toml).
//
// When a node closes a take, it writes the roots of the hash trees (take/ledger/hashed_file.h) of
// the files that it recorded, and signs them with its Ed25519 key. docs/takes.md describes the
// format; take/ledger/signature_check.h verifies signatures.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "base/core/time.h"
#include "base/io/result.h"
#include "take/take.h"
#include "take/take_files.h"
#include "wire/signing_key.h"

namespace v3d {

/// The content of signature.<node>.toml.
struct TakeSignature {
  std::string take;
  std::string studio;
  std::string node;
  PublicKey key;
  RealtimeInstant started;
  RealtimeInstant signed_at;
  double rate_hz = 0;
  int64_t pulses = 0;
  TakeState state = TakeState::kComplete;
  /// All files of the node for which is_signed_file() holds. A file without a root is signed by its
  /// length only: a camera log that was recorded before the daemon restarted.
  std::vector<TakeFile> files;
};

/// A node and its signing key.
struct TakeSigner {
  std::string node;
  SigningKey key;
};

/// Whether signatures cover the file of this name: every file that is written before the ledger,
/// but for take.toml. The fields of take.toml stand in the signature itself.
bool is_signed_file(std::string_view name);

/// Signs a closed take as `signer`. `files`: roots that are known already, as of
/// EventLogWriter::file(). Other files are read, except for camera logs. Replaces an earlier
/// signature of this node. Fails with path and cause.
[[nodiscard]] io::Status sign_take(const TakePaths& paths, const TakeSigner& signer,
                                   const std::vector<TakeFile>& files);

/// Reads all files, camera logs included, and signs the take: after a recovery.
[[nodiscard]] io::Status sign_recovered_take(const TakePaths& paths, const TakeSigner& signer);

/// Signs `signature` with `key` and replaces signature.<node>.toml. Fails with path and cause.
[[nodiscard]] io::Status save_signature(const TakePaths& paths, const TakeSignature& signature,
                                        const SigningKey& key);

/// Throws InputError with file, line and field; also when the signature does not match the text
/// under the public key that the text names.
TakeSignature parse_signature(std::string_view text, const std::filesystem::path& path);

}  // namespace v3d
