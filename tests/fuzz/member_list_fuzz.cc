// Fuzz target: member lists, with and without a valid signature of the authority, and signed
// messages. Any bytes are read or rejected with an InputError. Without a valid signature they are
// no list.
#include <cstdlib>
#include <string>
#include <string_view>

#include "base/core/error.h"
#include "wire/member_list.h"
#include "wire/signatures.h"

namespace {

const v3d::wire::SigningKey& authority() {
  static const v3d::wire::SigningKey made = v3d::wire::SigningKey::make();
  return made;
}

bool is_list(std::string_view text) {
  try {
    v3d::wire::parse_member_list(text, "members.toml", authority().public_key(), "kyoto");
    return true;
  } catch (const v3d::InputError&) {
    return false;
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  if (is_list(text)) std::abort();
  is_list(v3d::wire::sign_text(text, authority()));
  if (const auto split = v3d::wire::split_signature({data, size})) {
    if (split->is_signed_by(authority().public_key())) std::abort();
  }
  return 0;
}
