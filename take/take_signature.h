// Signatures of takes: who recorded what, and that a copy is what was recorded.
//
// At the end of a take every node that has a signing key writes signature.<node>.toml: the roots of
// the hash trees (wire/hash_tree.h) of the files that it recorded, signed with Ed25519. The leaves
// of an event log's tree are its events, whole, from sync word to last byte; where no event stands,
// and in all other files, blocks of 1 MiB. docs/takes.md has the format.
#pragma once

#include <string>
#include <vector>

#include "base/io/result.h"
#include "base/studio_file.h"
#include "base/time.h"
#include "take/take.h"
#include "take/take_files.h"
#include "wire/signing_key.h"

namespace v3d {

/// Length and root of a file. Reads all of it where it has `bytes` bytes; where it has another
/// length, the root is empty. Memory: 1 MiB. Fails with path and cause.
[[nodiscard]] io::Result<TakeFile> hash_take_file(const TakePaths& paths, const std::string& name,
                                                  int64_t bytes);

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
  /// Without those that are written after the ledger, and without take.toml, whose content stands
  /// above. A log without a root is one that a recovery found.
  std::vector<TakeFile> files;
};

/// Who signs.
struct TakeSigner {
  std::string node;
  SigningKey key;
};

/// Signs a take that is closed. `files`: what is known of them; other files, but for logs of
/// cameras, are read. Replaces the signature of this node, if there is one. Fails with path and
/// cause.
[[nodiscard]] io::Status sign_take(const TakePaths& paths, const TakeSigner& signer,
                                   const std::vector<TakeFile>& files);

/// The same, and reads the logs of the cameras, too: for a take that was recovered.
[[nodiscard]] io::Status sign_recovered_take(const TakePaths& paths, const TakeSigner& signer);

/// Throws InputError with file, line and field; also when the signature is not one of this text by
/// its own public key.
TakeSignature parse_signature(std::string_view text, const std::filesystem::path& path);

/// One signature of a take, which is right.
struct SignedBy {
  std::string node;
  PublicKey key;
  bool is_known = false;  ///< the studio file has this key for this node
  RealtimeInstant signed_at;
  int64_t files = 0;  ///< that are what was signed
};

struct SignatureCheck {
  std::vector<SignedBy> signers;
  /// A signature is wrong or by another key than the studio file's, or a file is not what was
  /// signed; one line each.
  std::vector<std::string> disagreements;
  /// What nobody signed, or only somebody unknown; one line each.
  std::vector<std::string> notes;
  /// Every node of the studio that recorded a camera of the take has signed it.
  bool by_all_nodes = false;
};

/// Reads every signed file. `studio`: whose keys are trusted, and which node has which camera; null
/// where there is none: then no signer is known. Throws InputError when the folder is no take.
SignatureCheck check_signatures(const TakePaths& paths, const Studio* studio);

}  // namespace v3d
