#include "daemon/message_seal.h"

namespace v3d {
namespace {

/// So long a refusal is worth a line in health.
constexpr Duration kTold = std::chrono::seconds(10);

}  // namespace

void MessageSeal::set_key(const StudioKey& key) {
  const std::lock_guard lock(mutex_);
  mac_ = std::make_shared<const DatagramMac>(key);
  has_key_ = true;
}

std::shared_ptr<const DatagramMac> MessageSeal::mac() const {
  if (!has_key_) return nullptr;
  const std::lock_guard lock(mutex_);
  return mac_;
}

void MessageSeal::count_forged() {
  ++forged_;
  report(
      "messages without the studio's seal are refused: a stranger, or another studio key than "
      "here");
}

SealCounts MessageSeal::counts() const {
  return {.forged = forged_, .stale = stale_, .replayed = replayed_};
}

std::string MessageSeal::trouble(RealtimeInstant now) const {
  const std::lock_guard lock(mutex_);
  return now - troubled_ < kTold ? trouble_ : "";
}

void MessageSeal::report(std::string_view trouble) {
  const std::lock_guard lock(mutex_);
  trouble_ = trouble;
  troubled_ = Realtime::now();
}

}  // namespace v3d
