// Verification of the signatures of a take (take/ledger/take_signature.h).
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "base/config/studio_file.h"
#include "base/core/time.h"
#include "take/ledger/take_signature.h"
#include "take/take.h"
#include "wire/signatures.h"

namespace v3d::take {

/// A signature file whose signature matches its text.
struct SignedBy {
  std::string node;
  wire::PublicKey key;
  bool is_known = false;  ///< the studio file lists this key for this node
  RealtimeInstant signed_at;
  SigningOccasion occasion = SigningOccasion::kUnknown;
  int64_t files = 0;  ///< number of files of the take that match this signature
};

struct SignatureCheck {
  std::vector<SignedBy> signers;
  /// One line for each invalid signature, each key that differs from the studio file's, each file
  /// that does not match its signature, and each contradiction between signatures, take.toml and
  /// ledger: nodes, cameras, state, counts of frames.
  std::vector<std::string> disagreements;
  /// One line for each unknown key, each signature of format 1, each node without a signature, and
  /// for files without a signature.
  std::vector<std::string> notes;
  /// True when every capture node of the take has signed with a known key, and the root of every
  /// file matches a signature with a known key. The signatures name the nodes; take.toml alone does
  /// not prove that no node was removed. So one signature of format 2 is needed. The part of one
  /// node of several is never complete.
  bool is_complete = false;
};

/// Verifies the signatures of a take; reads every signed file.
///
/// Only keys of `studio` are trusted. A signature with an unknown key is used for a file only when
/// no known key has signed that file. The log and plates of a camera require the signature of the
/// node that owns the camera. `studio` is null when there is no studio file; then no key is known.
/// Throws InputError when the folder is not a take.
SignatureCheck check_signatures(const TakePaths& paths, const Studio* studio);

}  // namespace v3d::take
