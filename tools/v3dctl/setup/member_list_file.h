// The member list of a studio file.
#pragma once

#include "base/config/studio_file.h"
#include "base/core/error.h"
#include "base/io/file.h"
#include "wire/member_list.h"

namespace v3d::ctl {

/// Throws InputError where the file names none or another, as PublicKey::parse() does.
inline PublicKey authority_of(const Studio& studio) {
  return PublicKey::parse(studio.network.authority, studio.path.string() + ": network.authority");
}

/// Throws InputError when the file cannot be read, and as parse_member_list() does.
inline MemberList load_member_list(const Studio& studio) {
  const std::filesystem::path& path = studio.network.members;
  const std::string text = io::value_or_throw(io::read_file(path, kMaxMemberListBytes));
  return parse_member_list(text, path, authority_of(studio), studio.name);
}

}  // namespace v3d::ctl
