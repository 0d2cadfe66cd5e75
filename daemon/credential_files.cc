#include "daemon/credential_files.h"

#include <utility>

#include "base/error.h"

namespace v3d {

CredentialFiles::CredentialFiles(std::filesystem::path studio_key, Credentials& credentials,
                                 MessageSeal& seal)
    : key_file_(std::move(studio_key)), credentials_(credentials), seal_(seal) {}

std::string CredentialFiles::poll(MonotonicInstant now) {
  credentials_.forget_old_key(now);
  seal_.forget_old_key(now);
  try {
    const std::string news = read_key(now);
    const bool was_wrong = !std::exchange(problem_, "").empty();
    return news.empty() && was_wrong ? key_file_.string() + " is readable again" : news;
  } catch (const InputError& error) {
    const std::string effect = is_ready() ? "the previous studio key stays in use: " : "";
    const std::string before = std::exchange(problem_, effect + error.what());
    return problem_ == before ? "" : problem_;
  }
}

std::string CredentialFiles::read_key(MonotonicInstant now) {
  const StudioKey read = StudioKey::load(key_file_);
  if (key_ && *key_ == read) return "";
  const bool is_first = !key_;
  key_ = read;
  credentials_.set_studio_key(read, now);
  seal_.set_key(read, now);
  if (is_first) return "";
  return key_file_.string() +
         ": a new studio key; messages carry it in 10 s, and the old one is accepted for 20 s";
}

}  // namespace v3d
