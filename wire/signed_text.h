// A text file that is signed: its first line is the Ed25519 signature of all bytes behind that
// line.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "wire/signing_key.h"

namespace v3d {

struct SignedText {
  Signature signature{};
  std::string_view text;  ///< that is signed; a part of the file's text

  bool is_signed_by(const PublicKey& key) const;
};

/// The file's text: signature = '<128 hexadecimal digits>', a line end, and `text`.
std::string sign_text(std::string_view text, const SigningKey& key);
/// Verifies nothing. Throws InputError when the first line is no signature; `path` names the file.
SignedText split_signed_text(std::string_view file, const std::filesystem::path& path);

}  // namespace v3d
