// The member list that a studio file names.
#pragma once

#include <filesystem>
#include <functional>
#include <string>

#include "base/config/studio_file.h"
#include "wire/member_list.h"

namespace v3d::ctl {

/// Throws InputError where the studio file names no member list.
void require_member_list(const Studio& studio);

/// The public key of the authority. Throws InputError where the studio file contains none or an
/// invalid one (PublicKey::parse()).
wire::PublicKey authority_of(const Studio& studio);

/// The verified member list. Throws InputError when the file cannot be read, and like
/// parse_member_list().
wire::MemberList load_member_list(const Studio& studio);

/// A member list that was changed, but not written.
struct ChangedMemberList {
  std::string text;  ///< of the file, with the signature
  int64_t serial = 0;
};

/// Applies `change` to the current list (an empty one where the file does not exist), and signs it
/// with the next serial number. `authority_file`: the secret key of the authority.
///
/// Throws InputError where the studio file names no list, the key is not that of the studio's
/// authority, or the list would be invalid; and what `change` throws.
ChangedMemberList changed_member_list(const Studio& studio,
                                      const std::filesystem::path& authority_file,
                                      const std::function<void(wire::MemberList&)>& change);

}  // namespace v3d::ctl
