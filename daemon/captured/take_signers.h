// Signers of the takes of a capture node: its present key, takes that a recovery has closed.
#pragma once

#include <condition_variable>
#include <filesystem>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "base/config/studio_file.h"
#include "take/ledger/take_signature.h"
#include "take/take.h"

namespace v3d::captured {

// The key with which a capture node signs its takes.

/// Holds the present key. A take keeps the signer that it was armed with. One thread.
class NodeSigner {
 public:
  /// `studio` outlives this object.
  NodeSigner(const Studio& studio, std::string node) : studio_(studio), node_(std::move(node)) {}

  /// Replaces the key, for takes that are armed from now on.
  void set_key(const wire::SigningKey& key);
  /// Null before the first set_key(): takes are not signed.
  std::shared_ptr<const take::TakeSigner> signer() const { return signer_; }

  /// One line when the studio file lists another public key for this node, so that `v3dctl verify`
  /// rejects its signatures; otherwise empty. When the studio file as read at the start lists
  /// another, it is read again, because it may have been changed with the key.
  std::string warning() const;

 private:
  bool is_listed_by(const Studio& studio) const;

  const Studio& studio_;
  const std::string node_;
  std::shared_ptr<const take::TakeSigner> signer_;
};

// Signs the takes that a recovery has closed, in the background.

/// The takes in the folder of takes that a recovery has closed and `node` has to sign: it recorded
/// them by their studio file, which names a signing key, and there is no signature.<node>.toml.
/// Skips takes whose take.toml cannot be read. `errors` gets one line for each other take that
/// cannot be examined.
std::vector<take::TakePaths> unsigned_recovered_takes(const std::filesystem::path& takes,
                                                      const std::string& node,
                                                      std::vector<std::string>& errors);

/// After a recovery nothing is known of a log but its end, so the whole take must be read to sign
/// it. A thread does this, which the first search() starts, while the node does not record. The
/// signature states SigningOccasion::kRecovery. A take that is not signed when the daemon ends is
/// found by the first search of the next start.
///
/// Call from one thread. Only hold() may wait for the disk.
class RecoveredTakeSigner {
 public:
  struct Result {
    std::string take;   ///< its folder's name; empty in an error that belongs to no take
    std::string error;  ///< one line with path and cause; empty: the take was signed
  };

  RecoveredTakeSigner(const Studio& studio, std::string node);
  /// Waits for the thread, which reads at most 1 MiB more.
  ~RecoveredTakeSigner();
  RecoveredTakeSigner(const RecoveredTakeSigner&) = delete;
  RecoveredTakeSigner& operator=(const RecoveredTakeSigner&) = delete;

  /// Searches for takes and signs them as `signer`. To be called with a new key, and after a take
  /// was recovered. Does nothing when `signer` is null.
  void search(std::shared_ptr<const take::TakeSigner> signer);
  /// While paused, the thread reads nothing: recording comes first.
  void set_paused(bool paused);
  /// While the result exists, this object neither locks a take nor writes a signature. Needed while
  /// the node begins to record into a recovered take again.
  [[nodiscard]] std::unique_lock<std::mutex> hold() { return std::unique_lock(saving_); }

  /// Takes that were found and are not signed yet.
  int64_t pending() const;
  /// The results since the last call.
  std::vector<Result> results();

 private:
  void run();
  std::shared_ptr<const take::TakeSigner> wait_for_search();
  /// Waits while paused. False when the thread has to end.
  bool may_continue();
  bool is_stopping() const;
  void sign_all(const take::TakeSigner& signer);
  io::Status sign(const take::TakePaths& take, const take::TakeSigner& signer);
  io::Status save(const take::TakePaths& take, const take::TakeSignature& signature,
                  const take::TakeSigner& signer);
  void add_result(Result result);
  void set_pending(size_t takes);

  const std::filesystem::path takes_;
  const std::string node_;
  std::mutex saving_;         ///< held while a take is locked and its signature written
  mutable std::mutex mutex_;  ///< guards the members below
  std::condition_variable changed_;
  std::shared_ptr<const take::TakeSigner> next_signer_;  ///< null: no search is requested
  bool paused_ = false;
  bool stopping_ = false;
  size_t pending_ = 0;
  std::vector<Result> results_;
  std::thread thread_;  ///< started by the first search(); last member
};

}  // namespace v3d::captured
