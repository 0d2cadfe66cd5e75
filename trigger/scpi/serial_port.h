// An instrument on a serial port.
#pragma once

#include <filesystem>
#include <string>

#include "base/core/time.h"
#include "trigger/scpi/instrument.h"

namespace v3d {

/// 8 data bits, no parity, 1 stop bit, no flow control; lines end in CR LF, answers
/// in LF. The port is for this process alone.
class SerialPort : public Instrument {
 public:
  /// `baud` as in the studio file. Throws InstrumentError when it is not there, InputError when it
  /// may not be used.
  SerialPort(const std::filesystem::path& device, int baud);
  ~SerialPort() override;
  SerialPort(const SerialPort&) = delete;
  SerialPort& operator=(const SerialPort&) = delete;

  void write(const std::string& line) override;
  std::string query(const std::string& line) override;

 private:
  void set_up(int baud);
  /// False when nothing can be read or written before the time-out.
  bool wait_for(short events, MonotonicInstant deadline) const;

  int fd_ = -1;
};

}  // namespace v3d
