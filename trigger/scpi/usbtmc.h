// Instrument of the USB Test and Measurement Class (USBTMC).
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "trigger/scpi/instrument.h"
#include "trigger/scpi/usb_port.h"

namespace v3d {

/// Aborts a transfer after a time-out, clears stalls, and clears an instrument that sends invalid
/// data. So the next call starts from a defined state.
class Usbtmc : public Instrument {
 public:
  explicit Usbtmc(std::unique_ptr<UsbPort> port);

  void write(const std::string& line) override;
  std::string query(const std::string& line) override;

 private:
  std::string read();
  /// Requests one part of the answer and appends it to `text`. Returns true when the message is
  /// complete.
  bool read_part(std::string& text);
  void receive(std::vector<uint8_t>& bytes);
  uint8_t next_tag();
  /// Sends INITIATE_..., then CHECK_..._STATUS until the operation is no longer pending, at most 20
  /// times.
  void initiate_and_wait(UsbtmcRequest initiate, UsbtmcRequest check, uint16_t value);
  [[noreturn]] void fail(UsbOutcome outcome, UsbtmcRequest abort, UsbtmcRequest check);
  [[noreturn]] void fail_protocol(const std::string& what);

  const std::unique_ptr<UsbPort> port_;
  uint8_t tag_ = 0;
};

}  // namespace v3d
