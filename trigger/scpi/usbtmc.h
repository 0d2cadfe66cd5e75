// USBTMC: messages and their exchange over a USB port.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "trigger/scpi/instrument.h"
#include "trigger/scpi/usb_port.h"

namespace v3d::trigger {

// Instrument of the USB Test and Measurement Class (USBTMC).

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

// Messages of USBTMC (USB Test and Measurement Class 1.0, section 3): a header of 12 bytes, the
// text, and zeros up to a multiple of 4.

inline constexpr size_t kUsbtmcHeader = 12;

/// DEV_DEP_MSG_OUT with the whole message. `tag` is 1 to 255.
std::vector<uint8_t> usbtmc_out(uint8_t tag, std::string_view text);
/// REQUEST_DEV_DEP_MSG_IN for up to `max_bytes` bytes.
std::vector<uint8_t> usbtmc_request(uint8_t tag, uint32_t max_bytes);

/// The header of a received message and the text of its first transfer.
struct UsbtmcIn {
  uint32_t size = 0;      ///< bytes of text that follow this header, in one or more transfers
  bool end = false;       ///< they are the last ones of the message
  std::string_view text;  ///< the part in this transfer; a view into it
};
/// Parses the first transfer of a DEV_DEP_MSG_IN. Empty when it is not one or has another tag.
std::optional<UsbtmcIn> parse_usbtmc_in(std::span<const uint8_t> transfer, uint8_t tag);

}  // namespace v3d::trigger
