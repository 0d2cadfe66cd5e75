#include "daemon/captured/take_signers.h"

#include <algorithm>
#include <optional>
#include <utility>

#include "base/core/error.h"
#include "base/io/file.h"
#include "take/ledger/ledger.h"
#include "take/take_lock.h"

namespace v3d::captured {

void NodeSigner::set_key(const wire::SigningKey& key) {
  signer_ = std::make_shared<const take::TakeSigner>(take::TakeSigner{node_, key});
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

namespace {

namespace fs = std::filesystem;

bool is_recovered(const take::TakePaths& take) {
  try {
    const auto info = io::type_of(take.info());
    return info && *info != fs::file_type::not_found &&
           load_take_info(take).state == take::TakeState::kRecovered;
  } catch (const InputError&) {  // the recovery of open takes reports it
    return false;
  }
}

/// Throws InputError when the take cannot be examined.
bool lacks_signature(const take::TakePaths& take, const std::string& node) {
  if (io::value_or_throw(io::type_of(signature_path(take, node))) != fs::file_type::not_found) {
    return false;
  }
  const std::optional<Studio> studio = load_take_studio(take);
  return studio && !studio->storage.signing_key.empty() &&
         (studio->trigger.node == node || !studio->cameras_of(node).empty());
}

/// The files that change when a take is recorded again or recovered again. Throws InputError.
std::string account_of(const take::TakePaths& take) {
  return io::value_or_throw(io::read_file(take.info(), take::kMaxLedgerBytes)) +
         io::value_or_throw(io::read_file(take.ledger(), take::kMaxLedgerBytes));
}

}  // namespace

std::vector<take::TakePaths> unsigned_recovered_takes(const fs::path& takes,
                                                      const std::string& node,
                                                      std::vector<std::string>& errors) {
  std::vector<take::TakePaths> found;
  const auto folders = io::list_folder(takes);
  if (!folders) {
    errors.push_back(folders.error().message);
    return found;
  }
  for (const fs::path& folder : *folders) {
    const take::TakePaths take{folder};
    try {
      if (is_recovered(take) && lacks_signature(take, node)) found.push_back(take);
    } catch (const InputError& error) {
      errors.emplace_back(error.what());
    }
  }
  std::ranges::sort(found, {}, &take::TakePaths::folder);
  return found;
}

RecoveredTakeSigner::RecoveredTakeSigner(const Studio& studio, std::string node)
    : takes_(studio.storage.takes), node_(std::move(node)) {}

RecoveredTakeSigner::~RecoveredTakeSigner() {
  {
    const std::scoped_lock lock(mutex_);
    stopping_ = true;
  }
  changed_.notify_all();
  if (thread_.joinable()) thread_.join();
}

void RecoveredTakeSigner::search(std::shared_ptr<const take::TakeSigner> signer) {
  if (!signer) return;
  {
    const std::scoped_lock lock(mutex_);
    next_signer_ = std::move(signer);
  }
  changed_.notify_all();
  if (!thread_.joinable()) thread_ = std::thread([this] { run(); });
}

void RecoveredTakeSigner::set_paused(bool paused) {
  {
    const std::scoped_lock lock(mutex_);
    paused_ = paused;
  }
  changed_.notify_all();
}

int64_t RecoveredTakeSigner::pending() const {
  const std::scoped_lock lock(mutex_);
  return static_cast<int64_t>(pending_);
}

std::vector<RecoveredTakeSigner::Result> RecoveredTakeSigner::results() {
  const std::scoped_lock lock(mutex_);
  return std::exchange(results_, {});
}

// --- the thread ---------------------------------------------------------------------------------

void RecoveredTakeSigner::run() {
  while (const auto signer = wait_for_search()) sign_all(*signer);
}

/// Null when the thread has to end.
std::shared_ptr<const take::TakeSigner> RecoveredTakeSigner::wait_for_search() {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [&] { return stopping_ || next_signer_; });
  return stopping_ ? nullptr : std::exchange(next_signer_, nullptr);
}

bool RecoveredTakeSigner::may_continue() {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [&] { return stopping_ || !paused_; });
  return !stopping_;
}

bool RecoveredTakeSigner::is_stopping() const {
  const std::scoped_lock lock(mutex_);
  return stopping_;
}

void RecoveredTakeSigner::sign_all(const take::TakeSigner& signer) {
  if (!may_continue()) return;
  std::vector<std::string> errors;
  const std::vector<take::TakePaths> takes = unsigned_recovered_takes(takes_, node_, errors);
  for (std::string& error : errors) add_result({.take = "", .error = std::move(error)});
  for (size_t i = 0; i < takes.size(); ++i) {
    set_pending(takes.size() - i);
    const io::Status signed_now = sign(takes[i], signer);
    if (!signed_now && is_stopping()) return;
    // A take that the node records again is signed at its stop.
    if (!signed_now && !is_recovered(takes[i])) continue;
    add_result({.take = takes[i].folder.filename(),
                .error = signed_now ? "" : signed_now.error().message});
  }
  set_pending(0);
}

io::Status RecoveredTakeSigner::sign(const take::TakePaths& take, const take::TakeSigner& signer) {
  try {
    const std::string before = account_of(take);
    const auto signature = read_signature(take, signer, take::SigningOccasion::kRecovery,
                                          [this] { return may_continue(); });
    if (!signature) return tl::make_unexpected(signature.error());
    const std::scoped_lock lock(saving_);
    // A process that records into the take, or deletes it, holds its lock.
    const auto take_lock = take::TakeLock::acquire(take, node_);
    if (!take_lock) return tl::make_unexpected(take_lock.error());
    if (!is_recovered(take) || account_of(take) != before) {
      return io::io_error("sign", take.folder, "it was changed while it was read");
    }
    return save_signature(take, *signature, signer.key);
  } catch (const InputError& error) {
    return io::io_error("sign", take.folder, error.what());
  }
}

void RecoveredTakeSigner::add_result(Result result) {
  const std::scoped_lock lock(mutex_);
  results_.push_back(std::move(result));
}

void RecoveredTakeSigner::set_pending(size_t takes) {
  const std::scoped_lock lock(mutex_);
  pending_ = takes;
}

}  // namespace v3d::captured
