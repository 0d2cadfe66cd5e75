// Converts exceptions into HTTP answers.
#pragma once

#include <spdlog/spdlog.h>

#include <utility>

#include "base/core/error.h"
#include "daemon/web/web_message.h"

namespace v3d {

/// The answer of `make`; 404 if it throws InputError, 500 for other exceptions. The text of the
/// exception, which may contain paths, is only logged.
template <class Make>
WebAnswer guarded_answer(const Make& make) {
  try {
    return make();
  } catch (const InputError& error) {
    spdlog::warn("{}", error.what());
    return plain_answer(404, "not found or not readable; see the log of v3d-viewd");
  } catch (const std::exception& error) {
    spdlog::error("{}", error.what());
    return plain_answer(500, "internal error; see the log of v3d-viewd");
  }
}

/// An answer that `make` makes later, as work of this kind. `make` owns what it uses.
template <class Make>
WebAnswer later_answer(WorkKind kind, Make make) {
  return {.work = [make = std::move(make)] { return guarded_answer(make); }, .kind = kind};
}

}  // namespace v3d
