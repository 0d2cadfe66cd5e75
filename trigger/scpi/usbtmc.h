// An instrument of the USB Test and Measurement Class.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "trigger/scpi/instrument.h"
#include "trigger/scpi/usb_port.h"

namespace v3d {

/// A transfer that times out is aborted, a stall taken off, and an instrument that talks nonsense
/// is cleared, so that the next call begins afresh.
class Usbtmc : public Instrument {
 public:
  explicit Usbtmc(std::unique_ptr<UsbPort> port);

  void write(const std::string& line) override;
  std::string query(const std::string& line) override;

 private:
  std::string read();
  /// One answer to one request; true when the message is whole.
  bool read_part(std::string& text);
  void receive(std::vector<uint8_t>& bytes);
  uint8_t next_tag();
  /// INITIATE_... and CHECK_..._STATUS until the instrument is through with it.
  void settle(UsbtmcRequest initiate, UsbtmcRequest check, uint16_t value);
  [[noreturn]] void fail(UsbOutcome outcome, UsbtmcRequest abort, UsbtmcRequest check);
  [[noreturn]] void fail_nonsense(const std::string& what);

  const std::unique_ptr<UsbPort> port_;
  uint8_t tag_ = 0;
};

}  // namespace v3d
