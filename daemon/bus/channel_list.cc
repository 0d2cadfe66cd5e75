#include "daemon/bus/channel_list.h"

#include <algorithm>
#include <array>
#include <cstdint>

#include "base/core/text.h"
#include "daemon/bus/datagram.h"
#include "wire/datagram_mac.h"
#include "wire/messages.h"
#include "wire/signatures.h"

namespace v3d::bus {
namespace {

using enum ChannelKind::Of;
using enum ChannelKind::Author;

constexpr size_t kKiB = 1024;
constexpr size_t kMiB = 1024 * kKiB;

/// The limits permit raw frames of 12 megapixels, meshes of a million triangles and ledgers of long
/// takes. Health has room for 200 cameras with short names, or 100 with long ones. Pulses, events
/// and commands have small limits.
constexpr std::array<ChannelKind, 12> kKinds = {{
    {.name = wire::kCommandChannel, .max_bytes = 16 * kKiB, .holds_own_mac = true},
    {.name = wire::kReplyChannel, .max_bytes = 4 * kMiB, .holds_own_mac = true},
    {.name = wire::kPulseChannel, .max_bytes = 4 * kKiB, .needs_challenge = true, .author = kOwner},
    {.name = wire::kEventChannel, .max_bytes = 32 * kKiB, .author = kNodeInside},
    {.name = wire::kSessionChannel,
     .max_bytes = kKiB,
     .is_of_sessions = true,
     .author = kAnyMember},
    {.name = wire::kMeshChannel, .max_bytes = kMaxMessage, .author = kReconstruction},
    {.name = wire::kFramePrefix, .of = kCameras, .max_bytes = kMaxMessage, .is_of_frames = true},
    {.name = wire::kFrameKeyPrefix,
     .of = kNodes,
     .max_bytes = 8 * kKiB,
     .needs_challenge = true,
     .is_of_frame_keys = true,
     .author = kOwner},
    {.name = wire::kPreviewPrefix, .of = kCameras, .max_bytes = 4 * kMiB, .author = kOwner},
    {.name = wire::kHealthPrefix,
     .of = kNodes,
     .max_bytes = 256 * kKiB,
     .is_shown_unverified = true,
     .needs_challenge = true,
     .author = kOwner},
    {.name = wire::kShardPrefix, .of = kNodes, .max_bytes = kMiB, .author = kReconstructionOwner},
    {.name = wire::kShardMeshPrefix,
     .of = kNodes,
     .max_bytes = kMaxMessage,
     .author = kReconstructionOwner},
}};

bool is_of(const ChannelKind& kind, std::string_view channel) {
  if (kind.of == kStudio) return channel == kind.name;
  return channel.starts_with(kind.name) && is_file_name(channel.substr(kind.name.size()));
}

}  // namespace

const ChannelKind* kind_of(std::string_view channel) {
  const auto* const kind =
      std::ranges::find_if(kKinds, [&](const ChannelKind& k) { return is_of(k, channel); });
  return kind == kKinds.end() ? nullptr : kind;
}

ChannelList::ChannelList(const Studio& studio) : is_exact_(true) {
  for (const ChannelKind& kind : kKinds) {
    const std::string prefix(kind.name);
    if (kind.of == kStudio) names_[prefix] = "";
    if (kind.of == kNodes) {
      for (const StudioNode& node : studio.nodes) names_[prefix + node.name] = node.name;
    }
    if (kind.of == kCameras) {
      for (const StudioCamera& camera : studio.cameras) names_[prefix + camera.name] = camera.node;
    }
  }
  names_[wire::kPulseChannel] = studio.trigger.node;
}

const ChannelKind* ChannelList::find(std::string_view channel) const {
  if (is_exact_ && !names_.contains(channel)) return nullptr;
  return kind_of(channel);
}

std::string_view ChannelList::owner_of(std::string_view channel) const {
  if (is_exact_) {
    const auto known = names_.find(channel);
    return known == names_.end() ? std::string_view{} : known->second;
  }
  const ChannelKind* const kind = kind_of(channel);
  return kind != nullptr && kind->of == kNodes ? channel.substr(kind->name.size())
                                               : std::string_view{};
}

bool ChannelList::use(std::string_view channel) {
  if (names_.contains(channel)) return true;
  if (is_exact_ || names_.size() == kMaxNames) return false;
  names_.emplace(channel, "");
  return true;
}

bool is_shown_unverified(const Datagram& first, const ChannelKind& kind) {
  return first.is_whole() && kind.is_shown_unverified && first.message_size <= kMaxUnverifiedHealth;
}

size_t max_encoded_bytes(std::string_view channel, bool has_key) {
  const ChannelKind* const kind = kind_of(channel);
  const size_t limit = kind == nullptr ? kMaxMessage : kind->max_bytes;
  const bool is_signed = kind != nullptr && kind->is_signed();
  const size_t room = limit - wire::kMacTrailerSize - (is_signed ? wire::kMessageSignatureSize : 0);
  const bool is_unverified = !has_key && kind != nullptr && kind->is_shown_unverified;
  return is_unverified ? std::min(room, kMaxUnverifiedHealth) : room;
}

std::string shortened(const std::string& text, size_t max_bytes) {
  constexpr std::string_view kEnd = " ...";
  if (text.size() <= max_bytes) return text;
  size_t end = max_bytes - kEnd.size();
  const auto continues = [&](size_t i) { return (static_cast<uint8_t>(text[i]) & 0xc0) == 0x80; };
  while (end > 0 && continues(end)) --end;
  return text.substr(0, end) + std::string(kEnd);
}

}  // namespace v3d::bus
