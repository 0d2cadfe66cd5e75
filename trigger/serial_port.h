// An instrument on a serial port.
#pragma once

#include <filesystem>
#include <string>

#include "base/time.h"
#include "trigger/instrument.h"

namespace v3d {

/// 115,200 baud, 8 data bits, no parity, 1 stop bit, no flow control; lines end in CR LF, answers
/// in LF. The port is for this process alone.
class SerialPort : public Instrument {
 public:
  /// Throws InstrumentError when it is not there, InputError when it may not be used.
  explicit SerialPort(const std::filesystem::path& device);
  ~SerialPort() override;
  SerialPort(const SerialPort&) = delete;
  SerialPort& operator=(const SerialPort&) = delete;

  void write(const std::string& line) override;
  std::string query(const std::string& line) override;

 private:
  void set_up();
  /// False when nothing can be read or written before the time-out.
  bool wait_for(short events, MonotonicInstant deadline) const;

  int fd_ = -1;
};

}  // namespace v3d
