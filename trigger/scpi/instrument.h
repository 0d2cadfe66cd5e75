// Interface of a bench instrument that is controlled by lines of text (SCPI).
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "base/config/studio_file.h"
#include "base/core/error.h"

namespace v3d {

/// The instrument does not answer, was disconnected, or sends invalid data. A retry may succeed.
class InstrumentError : public InputError {
 public:
  using InputError::InputError;
};

/// The instrument is not connected. It may be plugged in again.
class InstrumentAbsent : public InstrumentError {
 public:
  using InstrumentError::InstrumentError;
};

/// Threads: one. Every call ends within about 1 s; after an error it takes somewhat longer, to
/// reset the connection for the next call.
class Instrument {
 public:
  virtual ~Instrument() = default;
  /// Sends a command; `line` without a line end. Throws InstrumentError.
  virtual void write(const std::string& line) = 0;
  /// Sends a query and returns the answer, one line without its end. Throws InstrumentError.
  virtual std::string query(const std::string& line) = 0;
};

/// Throws InstrumentError when the instrument is not connected, InputError when permission is
/// missing.
std::unique_ptr<Instrument> open_instrument(const StudioInstrument& address);
using OpenInstrument = std::function<std::unique_ptr<Instrument>(const StudioInstrument&)>;

/// Quotes an answer for a message: printable, at most 60 characters.
std::string in_quotes(const std::string& answer);

}  // namespace v3d
