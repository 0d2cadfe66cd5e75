// How a file of a take that grows is opened.
#pragma once

#include <cstdint>

namespace v3d {

enum class LogOpening : uint8_t {
  kNew,   ///< what stood there is gone
  kGoOn,  ///< behind what stands there
};

}  // namespace v3d
