#include "wire/signed_text.h"

#include "base/core/error.h"
#include "wire/hexadecimal.h"

namespace v3d {
namespace {

constexpr std::string_view kPrefix = "signature = '";
constexpr std::string_view kSuffix = "'\n";
constexpr size_t kDigits = 2 * kSignatureSize;

std::span<const uint8_t> bytes_of(std::string_view text) {
  return {reinterpret_cast<const uint8_t*>(text.data()), text.size()};
}

}  // namespace

bool SignedText::is_signed_by(const PublicKey& key) const {
  return key.has_signed(bytes_of(text), signature);
}

std::string sign_text(std::string_view text, const SigningKey& key) {
  std::string file(kPrefix);
  file += hexadecimal(key.sign(bytes_of(text)));
  file += kSuffix;
  return file += text;
}

SignedText split_signed_text(std::string_view file, const std::filesystem::path& path) {
  constexpr size_t kLine = kPrefix.size() + kDigits + kSuffix.size();
  SignedText split;
  const bool has_line = file.size() >= kLine && file.starts_with(kPrefix) &&
                        file.substr(kLine - kSuffix.size(), kSuffix.size()) == kSuffix;
  if (!has_line || !parse_hexadecimal(file.substr(kPrefix.size(), kDigits), split.signature)) {
    throw InputError(path.string() + ":1: expected signature = '<128 hexadecimal digits>'");
  }
  split.text = file.substr(kLine);
  return split;
}

}  // namespace v3d
