// The key with which a capture node signs its takes.
#pragma once

#include <memory>
#include <string>

#include "base/config/studio_file.h"
#include "take/ledger/take_signature.h"

namespace v3d {

/// Holds the present key. A take keeps the signer that it was armed with. One thread.
class NodeSigner {
 public:
  /// `studio` outlives this object.
  NodeSigner(const Studio& studio, std::string node) : studio_(studio), node_(std::move(node)) {}

  /// Replaces the key, for takes that are armed from now on.
  void set_key(const SigningKey& key);
  /// Null before the first set_key(): takes are not signed.
  std::shared_ptr<const TakeSigner> signer() const { return signer_; }

  /// One line when the studio file lists another public key for this node, so that `v3dctl verify`
  /// rejects its signatures; otherwise empty. When the studio file as read at the start lists
  /// another, it is read again, because it may have been changed with the key.
  std::string warning() const;

 private:
  bool is_listed_by(const Studio& studio) const;

  const Studio& studio_;
  const std::string node_;
  std::shared_ptr<const TakeSigner> signer_;
};

}  // namespace v3d
