// Options for opening a growing file of a take: new or continued, and which checksums to compute.
#pragma once

#include <cstdint>

namespace v3d {

enum class LogOpening : uint8_t {
  kNew,       ///< creates a new file
  kContinue,  ///< continues the file or log after a restart of the daemon
};

enum class LogHashing : uint8_t {
  kChecksum,  ///< the checksum for the ledger
  kTree,  ///< also the hash tree of the events, for the signature of the take (take_signature.h)
};

}  // namespace v3d
