// What a browser is told when an answer goes wrong.
#pragma once

#include <spdlog/spdlog.h>

#include "base/error.h"
#include "daemon/viewd/web_message.h"

namespace v3d {

/// What `make` answers; whatever goes wrong in it is a status. What exactly, with the paths of the
/// studio's files, is for the log alone.
template <class Make>
WebAnswer guarded_answer(const Make& make) {
  try {
    return make();
  } catch (const InputError& error) {
    spdlog::warn("{}", error.what());
    return plain_answer(404, "it is not there, or cannot be read; the log of v3d-viewd tells");
  } catch (const std::exception& error) {
    spdlog::error("{}", error.what());
    return plain_answer(500, "this went wrong; the log of v3d-viewd tells");
  }
}

}  // namespace v3d
