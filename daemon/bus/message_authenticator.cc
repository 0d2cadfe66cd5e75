#include "daemon/bus/message_authenticator.h"

namespace v3d {
namespace {

/// Time for which health shows the last rejection.
constexpr Duration kShownFor = std::chrono::seconds(10);

}  // namespace

void MessageAuthenticator::set_key(const StudioKey& key, MonotonicInstant now) {
  const std::lock_guard lock(mutex_);
  macs_.set(std::make_shared<const DatagramMac>(key), now);
  has_key_ = true;
}

void MessageAuthenticator::discard_old_key(MonotonicInstant now) {
  const std::lock_guard lock(mutex_);
  macs_.discard_old(now);
}

std::shared_ptr<const DatagramMac> MessageAuthenticator::mac(MonotonicInstant now) const {
  if (!has_key_) return nullptr;
  const std::lock_guard lock(mutex_);
  return *macs_.sending(now);
}

bool MessageAuthenticator::verify(std::span<const uint8_t> head, std::span<const uint8_t> data,
                                  const MacTrailer& trailer, MonotonicInstant now) const {
  if (!has_key_) return false;
  std::shared_ptr<const DatagramMac> newest, old;
  {
    const std::lock_guard lock(mutex_);
    newest = *macs_.newest();
    if (const auto* const mac = macs_.old(now)) old = *mac;
  }
  return newest->verify(head, data, trailer) || (old && old->verify(head, data, trailer));
}

void MessageAuthenticator::count_unverified() {
  if (!has_key_) {
    ++unkeyed_;
    return;
  }
  ++forged_;
  report(
      "messages without the MAC of the studio key are rejected: an attacker, or another studio "
      "key");
}

void MessageAuthenticator::count_forged_frame() {
  ++forged_;
  report("live frames without the MAC of their frame key are rejected: an attacker");
}

void MessageAuthenticator::count_unsigned(std::string_view problem) {
  ++not_signed_;
  report(problem);
}

RejectionCounts MessageAuthenticator::counts() const {
  return {.forged = forged_,
          .unkeyed = unkeyed_,
          .not_signed = not_signed_,
          .stale = stale_,
          .replayed = replayed_};
}

std::string MessageAuthenticator::trouble(RealtimeInstant now) const {
  const std::lock_guard lock(mutex_);
  return now - reported_at_ < kShownFor ? trouble_ : "";
}

void MessageAuthenticator::report(std::string_view trouble) {
  const std::lock_guard lock(mutex_);
  trouble_ = trouble;
  reported_at_ = Realtime::now();
}

}  // namespace v3d
