// Instruments, and those on a serial port.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <string>

#include "base/config/studio_file.h"
#include "base/core/error.h"
#include "base/core/time.h"

namespace v3d::trigger {

// Interface of a bench instrument that is controlled by lines of text (SCPI).

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

/// Another program has the instrument open. It may close it soon.
class InstrumentBusy : public InstrumentError {
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

/// Throws InstrumentError when the instrument is not connected or busy, InputError when permission
/// is missing.
std::unique_ptr<Instrument> open_instrument(const StudioInstrument& address);
using OpenInstrument = std::function<std::unique_ptr<Instrument>(const StudioInstrument&)>;

/// Quotes an answer for a message: printable, at most 60 characters.
std::string in_quotes(const std::string& answer);

// Instrument on a serial port.

/// What a person can do after open() of a serial port failed with `error_number`; may be empty.
std::string open_advice(int error_number);
/// Throws the error of a serial port whose open() failed with `error_number`: InstrumentAbsent,
/// InstrumentBusy, or InputError where a retry does not help.
[[noreturn]] void fail_to_open(const std::filesystem::path& device, int error_number);

/// 8 data bits, no parity, 1 stop bit, no flow control. Commands end with CR LF, answers with LF.
/// The port is opened for exclusive use.
class SerialPort : public Instrument {
 public:
  /// `baud` as in the studio file. Throws InstrumentError when the device does not exist or is
  /// busy, InputError when it cannot be used.
  SerialPort(const std::filesystem::path& device, int baud);
  ~SerialPort() override;
  SerialPort(const SerialPort&) = delete;
  SerialPort& operator=(const SerialPort&) = delete;

  void write(const std::string& line) override;
  std::string query(const std::string& line) override;

 private:
  struct Connection;
  std::unique_ptr<Connection> connection_;
};

}  // namespace v3d::trigger
