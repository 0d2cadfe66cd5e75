#include "v3dctl/setup/member_list_file.h"

#include "base/core/error.h"
#include "base/io/file.h"

namespace v3d::ctl {

void require_member_list(const Studio& studio) {
  if (!studio.network.members.empty()) return;
  throw InputError(studio.path.string() +
                   ": [network] members is missing; name the file of the list there, and the "
                   "public key of the authority");
}

wire::PublicKey authority_of(const Studio& studio) {
  return wire::PublicKey::parse(studio.network.authority,
                                studio.path.string() + ": network.authority");
}

wire::MemberList load_member_list(const Studio& studio) {
  const std::filesystem::path& path = studio.network.members;
  const std::string text = io::value_or_throw(io::read_file(path, wire::kMaxMemberListBytes));
  return parse_member_list(text, path, authority_of(studio), studio.name);
}

ChangedMemberList changed_member_list(const Studio& studio,
                                      const std::filesystem::path& authority_file,
                                      const std::function<void(wire::MemberList&)>& change) {
  require_member_list(studio);
  const wire::SigningKey authority = wire::SigningKey::load(authority_file, wire::kAuthorityKey);
  if (authority.public_key() != authority_of(studio)) {
    throw InputError(authority_file.string() + ": its public key is " +
                     authority.public_key().text() + ", but " + studio.path.string() +
                     " has a different key for [network] authority");
  }
  const std::filesystem::path& path = studio.network.members;
  wire::MemberList list{.studio = studio.name, .serial = 0, .members = {}};
  if (std::filesystem::exists(path)) list = load_member_list(studio);
  change(list);
  ++list.serial;
  ChangedMemberList changed{.text = sign_member_list(list, authority), .serial = list.serial};
  parse_member_list(changed.text, path, authority.public_key(), studio.name);
  return changed;
}

}  // namespace v3d::ctl
