// USB endpoints of an instrument: an interface, and its implementation with libusb. Only
// usb_port.cc includes libusb.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "base/config/studio_file.h"
#include "base/core/time.h"

namespace v3d::trigger {

enum class UsbOutcome : uint8_t { kDone, kTimeout, kStall, kGone, kError };

/// Control requests of the USBTMC class (USBTMC 1.0, table 15).
enum class UsbtmcRequest : uint8_t {
  kAbortOut = 1,
  kCheckAbortOut = 2,
  kAbortIn = 3,
  kCheckAbortIn = 4,
  kClear = 5,
  kCheckClear = 6,
};

/// Threads: one. Every call ends within its time-out.
class UsbPort {
 public:
  virtual ~UsbPort() = default;
  /// One bulk transfer to the instrument.
  virtual UsbOutcome send(std::span<const uint8_t> bytes, Duration timeout) = 0;
  /// One bulk transfer of at most bytes.size() bytes; `bytes` is resized to the received length.
  virtual UsbOutcome receive(std::vector<uint8_t>& bytes, Duration timeout) = 0;
  /// A control request with wValue `value`, to the endpoint or interface that it concerns.
  /// `status`: the first byte of the answer.
  virtual UsbOutcome request(UsbtmcRequest request, uint16_t value, uint8_t& status) = 0;
  /// Clears the halt condition of both bulk endpoints.
  virtual void clear_stalls() = 0;
};

/// Detaches the kernel's usbtmc driver until the object is destroyed. Throws InstrumentError when
/// the instrument is not connected or cannot be claimed. Throws InputError when permission is
/// missing or the device is not a USBTMC instrument.
std::unique_ptr<UsbPort> open_usb_port(const StudioInstrument& address);

}  // namespace v3d::trigger
