// Frame key: secret with which a node authenticates its live frames when there is a member list.
// Adapter of libsodium.
#pragma once

#include <optional>

#include "wire/datagram_mac.h"
#include "wire/messages.h"
#include "wire/signing_key.h"

namespace v3d {

/// A random secret of 256 bits. Its node draws it, and sends it sealed to the reconstruction nodes.
/// They verify the frames of this node with it; other holders of the studio key can neither forge
/// nor verify them. The secret is overwritten when the key is destroyed.
class FrameKey {
 public:
  /// Makes a new key from the random generator of the kernel.
  static FrameKey make();
  /// `secret`: 32 bytes.
  explicit FrameKey(SecretBuffer secret) : secret_(std::move(secret)) {}

  /// The key for the holder of the secret key of `recipient`, who alone can open it (sealed box of
  /// libsodium: X25519, XSalsa20, Poly1305). It does not state who sealed it: the message needs a
  /// signature. Empty when `recipient` is no point of Ed25519.
  std::optional<SealedFrameKey> seal_for(const PublicKey& recipient) const;
  /// Opens a sealed key. Empty when it was not sealed for `own`, or was changed.
  static std::optional<FrameKey> open(const SealedFrameKey& sealed, const SigningKey& own);

  /// The MAC of the node's frames. Its key is derived from this key alone: the replacement of the
  /// studio key does not change it.
  DatagramMac mac() const;

 private:
  SecretBuffer secret_;
};

}  // namespace v3d
