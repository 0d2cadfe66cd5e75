// A bench instrument that is told and asked one line at a time.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "base/config/studio_file.h"
#include "base/core/error.h"

namespace v3d {

/// The instrument does not answer, went away, or talks nonsense. Another try may help.
class InstrumentError : public InputError {
 public:
  using InputError::InputError;
};

/// It is not there, or not any more. It may be plugged in again.
class InstrumentAbsent : public InstrumentError {
 public:
  using InstrumentError::InstrumentError;
};

/// One thread. Every call ends within about a second, and after an error within
/// some more, that the next call may begin afresh.
class Instrument {
 public:
  virtual ~Instrument() = default;
  /// `line` without its end. Throws InstrumentError.
  virtual void write(const std::string& line) = 0;
  /// The answer to `line`, one line without its end. Throws InstrumentError.
  virtual std::string query(const std::string& line) = 0;
};

/// Throws InstrumentError when it is not there, InputError when it may not be used.
std::unique_ptr<Instrument> open_instrument(const StudioInstrument& address);
using OpenInstrument = std::function<std::unique_ptr<Instrument>(const StudioInstrument&)>;

/// What an instrument said, fit for a message: one line, printable, not long.
std::string in_quotes(const std::string& answer);

}  // namespace v3d
