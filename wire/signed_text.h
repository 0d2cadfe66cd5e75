// Signed text file. Its first line is the Ed25519 signature of all bytes after that line.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "wire/signing_key.h"

namespace v3d {

struct SignedText {
  Signature signature{};
  std::string_view text;  ///< the signed text; a view of the text of the file

  bool is_signed_by(const PublicKey& key) const;
};

/// Returns the text of the file: signature = '<128 hexadecimal digits>', a line end, and `text`.
std::string sign_text(std::string_view text, const SigningKey& key);
/// Splits signature and text without verifying. Throws InputError when the first line is no
/// signature. `path` is used in messages.
SignedText split_signed_text(std::string_view file, const std::filesystem::path& path);

}  // namespace v3d
