#include "daemon/captured/node_signer.h"

#include <algorithm>

#include "base/core/error.h"

namespace v3d {

void NodeSigner::set_key(const SigningKey& key) {
  signer_ = std::make_shared<const TakeSigner>(TakeSigner{node_, key});
}

/// True also when the studio file lists no key for the node.
bool NodeSigner::is_listed_by(const Studio& studio) const {
  const auto own = std::ranges::find(studio.nodes, node_, &StudioNode::name);
  return own == studio.nodes.end() || own->public_key.empty() ||
         own->public_key == signer_->key.public_key().text();
}

std::string NodeSigner::warning() const {
  if (!signer_ || is_listed_by(studio_)) return "";
  try {
    if (is_listed_by(load_studio(studio_.path))) return "";
  } catch (const InputError&) {  // the file is being changed
  }
  return studio_.storage.signing_key.string() + ": its public key is " +
         signer_->key.public_key().text() + ", but " + studio_.path.string() +
         " has another for node " + node_;
}

}  // namespace v3d
