#include "trigger/scpi/instrument.h"

#include "trigger/scpi/serial_port.h"
#include "trigger/scpi/usb_port.h"
#include "trigger/scpi/usbtmc.h"

namespace v3d {

std::unique_ptr<Instrument> open_instrument(const StudioInstrument& address) {
  if (!address.device.empty()) return std::make_unique<SerialPort>(address.device, address.baud);
  return std::make_unique<Usbtmc>(open_usb_port(address));
}

std::string in_quotes(const std::string& answer) {
  constexpr size_t kMaxCharacters = 60;
  std::string text = "'";
  for (const char c : answer.substr(0, kMaxCharacters)) text += c >= ' ' && c <= '~' ? c : '?';
  return text + (answer.size() > kMaxCharacters ? "...'" : "'");
}

}  // namespace v3d
