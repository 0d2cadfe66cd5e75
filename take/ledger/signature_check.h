// Verification of the signatures of a take (take/ledger/take_signature.h).
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "base/config/studio_file.h"
#include "base/core/time.h"
#include "take/take.h"
#include "wire/signing_key.h"

namespace v3d {

/// A signature that matches its text.
struct SignedBy {
  std::string node;
  PublicKey key;
  bool is_known = false;  ///< the studio file lists this key for this node
  RealtimeInstant signed_at;
  int64_t files = 0;  ///< files of the take that match this signature
};

struct SignatureCheck {
  std::vector<SignedBy> signers;
  /// One line each: an invalid signature, a key that differs from the studio file's, a file that
  /// does not match its signature.
  std::vector<std::string> disagreements;
  /// One line each: files without a signature, unknown keys.
  std::vector<std::string> notes;
  /// Every node of the studio that recorded a camera of the take has signed with a known key, and
  /// every file matches, by its root, the signature of a known key.
  bool is_complete = false;
};

/// Reads every signed file.
///
/// Only keys of `studio` are trusted. A signature with an unknown key counts for a file only where
/// no known key has signed that file. A camera's log and plates count only with the signature of
/// the node that has the camera. `studio` is null where there is no studio file: then no key is
/// known. Throws InputError when the folder is no take.
SignatureCheck check_signatures(const TakePaths& paths, const Studio* studio);

}  // namespace v3d
