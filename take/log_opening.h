// How a file of a take that grows is opened.
#pragma once

#include <cstdint>

namespace v3d {

enum class LogOpening : uint8_t {
  kNew,   ///< a file that does not exist yet
  kGoOn,  ///< continues what a restarted daemon left
};

}  // namespace v3d
