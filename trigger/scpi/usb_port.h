// A USB instrument's pipes. usb_port.cc is the adapter of libusb, the only file that sees it.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "base/config/studio_file.h"
#include "base/core/time.h"

namespace v3d {

enum class UsbOutcome : uint8_t { kDone, kTimeout, kStall, kGone, kError };

/// Requests of the class, to the endpoint or interface that they are meant for (USBTMC 1.0, table
/// 15).
enum class UsbtmcRequest : uint8_t {
  kAbortOut = 1,
  kCheckAbortOut = 2,
  kAbortIn = 3,
  kCheckAbortIn = 4,
  kClear = 5,
  kCheckClear = 6,
};

/// One thread. Every call ends within its time-out.
class UsbPort {
 public:
  virtual ~UsbPort() = default;
  virtual UsbOutcome send(std::span<const uint8_t> bytes, Duration timeout) = 0;
  /// One transfer of up to bytes.size(); resized to what came.
  virtual UsbOutcome receive(std::vector<uint8_t>& bytes, Duration timeout) = 0;
  /// `value`: the request's; the first byte of the answer is the instrument's status.
  virtual UsbOutcome request(UsbtmcRequest request, uint16_t value, uint8_t& status) = 0;
  /// Takes the stall off both pipes.
  virtual void clear_stalls() = 0;
};

/// Takes the instrument from the kernel's usbtmc driver until the object is destroyed. Throws
/// InstrumentError when it is not there, InputError when it may not be used or is no instrument.
std::unique_ptr<UsbPort> open_usb_port(const StudioInstrument& address);

}  // namespace v3d
