// Reads the member list that a studio file names, and verifies its signature.
#pragma once

#include "base/config/studio_file.h"
#include "base/core/error.h"
#include "base/io/file.h"
#include "wire/member_list.h"

namespace v3d::ctl {

/// The public key of the authority. Throws InputError where the studio file contains none or an
/// invalid one (PublicKey::parse()).
inline PublicKey authority_of(const Studio& studio) {
  return PublicKey::parse(studio.network.authority, studio.path.string() + ": network.authority");
}

/// The verified member list. Throws InputError when the file cannot be read, and like
/// parse_member_list().
inline MemberList load_member_list(const Studio& studio) {
  const std::filesystem::path& path = studio.network.members;
  const std::string text = io::value_or_throw(io::read_file(path, kMaxMemberListBytes));
  return parse_member_list(text, path, authority_of(studio), studio.name);
}

}  // namespace v3d::ctl
