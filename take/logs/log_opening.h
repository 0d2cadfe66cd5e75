// How a file of a take that grows is opened, and what is counted of it meanwhile.
#pragma once

#include <cstdint>

namespace v3d {

enum class LogOpening : uint8_t {
  kNew,   ///< a file that does not exist yet
  kGoOn,  ///< continues what a restarted daemon left
};

enum class LogHashing : uint8_t {
  kChecksum,  ///< for the ledger
  kTree,      ///< also the tree of its events, for the signature of the take (take_signature.h)
};

}  // namespace v3d
