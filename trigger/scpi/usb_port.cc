#include "trigger/scpi/usb_port.h"

#include <libusb.h>

#include <algorithm>
#include <array>
#include <string>

#include "trigger/scpi/instrument.h"

namespace v3d::trigger {
namespace {

constexpr unsigned kControlTimeoutMs = 500;
constexpr uint8_t kApplicationClass = 0xFE;
constexpr uint8_t kTestAndMeasurement = 3;

std::string usb_message(const std::string& what, int error) {
  return what + ": " + libusb_strerror(static_cast<libusb_error>(error));
}

UsbOutcome outcome_of(int error) {
  switch (error) {
    case LIBUSB_SUCCESS:
      return UsbOutcome::kDone;
    case LIBUSB_ERROR_TIMEOUT:
      return UsbOutcome::kTimeout;
    case LIBUSB_ERROR_PIPE:
      return UsbOutcome::kStall;
    case LIBUSB_ERROR_NO_DEVICE:
    case LIBUSB_ERROR_NOT_FOUND:
      return UsbOutcome::kGone;
    default:
      return UsbOutcome::kError;
  }
}

unsigned milliseconds(Duration d) {
  return static_cast<unsigned>(std::max<int64_t>(1, d / std::chrono::milliseconds(1)));
}

struct Library {
  Library() {
    const int error = libusb_init(&context);
    if (error != 0) throw InputError(usb_message("libusb", error));
  }
  ~Library() { libusb_exit(context); }
  Library(const Library&) = delete;
  Library& operator=(const Library&) = delete;
  libusb_context* context = nullptr;
};

/// The connected devices.
struct DeviceList {
  explicit DeviceList(const Library& library) {
    count = libusb_get_device_list(library.context, &devices);
  }
  ~DeviceList() {
    if (devices != nullptr) libusb_free_device_list(devices, 1);
  }
  DeviceList(const DeviceList&) = delete;
  DeviceList& operator=(const DeviceList&) = delete;
  libusb_device** devices = nullptr;
  ssize_t count = 0;
};

/// The USBTMC interface of a device and its bulk endpoints; interface -1: none.
struct Pipes {
  int interface = -1;
  uint8_t out = 0;
  uint8_t in = 0;
};

Pipes pipes_of(const libusb_interface_descriptor& interface) {
  Pipes pipes;
  if (interface.bInterfaceClass != kApplicationClass ||
      interface.bInterfaceSubClass != kTestAndMeasurement) {
    return pipes;
  }
  for (int i = 0; i < interface.bNumEndpoints; ++i) {
    const libusb_endpoint_descriptor& endpoint = interface.endpoint[i];
    if ((endpoint.bmAttributes & 3) != LIBUSB_TRANSFER_TYPE_BULK) continue;
    const bool in = (endpoint.bEndpointAddress & LIBUSB_ENDPOINT_IN) != 0;
    (in ? pipes.in : pipes.out) = endpoint.bEndpointAddress;
  }
  if (pipes.in != 0 && pipes.out != 0) pipes.interface = interface.bInterfaceNumber;
  return pipes;
}

Pipes find_pipes(libusb_device* device) {
  libusb_config_descriptor* configuration = nullptr;
  Pipes pipes;
  if (libusb_get_active_config_descriptor(device, &configuration) != 0) return pipes;
  for (int i = 0; i < configuration->bNumInterfaces && pipes.interface < 0; ++i) {
    const libusb_interface& interface = configuration->interface[i];
    if (interface.num_altsetting > 0) pipes = pipes_of(interface.altsetting[0]);
  }
  libusb_free_config_descriptor(configuration);
  return pipes;
}

class LibusbPort : public UsbPort {
 public:
  explicit LibusbPort(const StudioInstrument& address) : name_(address.text()) {
    open(address);
    try {
      claim();
    } catch (...) {
      libusb_close(handle_);
      throw;
    }
  }
  ~LibusbPort() override {
    libusb_release_interface(handle_, pipes_.interface);  // the kernel driver attaches again
    libusb_close(handle_);
  }
  LibusbPort(const LibusbPort&) = delete;
  LibusbPort& operator=(const LibusbPort&) = delete;

  UsbOutcome send(std::span<const uint8_t> bytes, Duration timeout) override {
    int sent = 0;
    const int error =
        libusb_bulk_transfer(handle_, pipes_.out, const_cast<uint8_t*>(bytes.data()),
                             static_cast<int>(bytes.size()), &sent, milliseconds(timeout));
    return outcome_of(error);
  }

  UsbOutcome receive(std::vector<uint8_t>& bytes, Duration timeout) override {
    int received = 0;
    const int error =
        libusb_bulk_transfer(handle_, pipes_.in, bytes.data(), static_cast<int>(bytes.size()),
                             &received, milliseconds(timeout));
    bytes.resize(static_cast<size_t>(std::max(0, received)));
    return outcome_of(error);
  }

  UsbOutcome request(UsbtmcRequest request, uint16_t value, uint8_t& status) override {
    const bool to_interface = request >= UsbtmcRequest::kClear;
    const bool about_in = request >= UsbtmcRequest::kAbortIn;
    const uint16_t pipe = about_in ? pipes_.in : pipes_.out;
    std::array<uint8_t, 8> answer{};
    const bool is_check_abort =
        request == UsbtmcRequest::kCheckAbortOut || request == UsbtmcRequest::kCheckAbortIn;
    const uint16_t size = request == UsbtmcRequest::kClear ? 1 : is_check_abort ? 8 : 2;
    const int n = libusb_control_transfer(
        handle_, to_interface ? 0xA1 : 0xA2, static_cast<uint8_t>(request), value,
        to_interface ? static_cast<uint16_t>(pipes_.interface) : pipe, answer.data(), size,
        kControlTimeoutMs);
    status = answer[0];
    return n < 0 ? outcome_of(n) : n == 0 ? UsbOutcome::kError : UsbOutcome::kDone;
  }

  void clear_stalls() override {
    libusb_clear_halt(handle_, pipes_.out);
    libusb_clear_halt(handle_, pipes_.in);
  }

 private:
  void open(const StudioInstrument& address) {
    const DeviceList list(library_);
    int open_error = 0;
    for (ssize_t i = 0; i < list.count && handle_ == nullptr; ++i) {
      libusb_device_descriptor descriptor{};
      libusb_get_device_descriptor(list.devices[i], &descriptor);
      if (descriptor.idVendor != address.vendor || descriptor.idProduct != address.product)
        continue;
      libusb_device_handle* handle = nullptr;
      open_error = libusb_open(list.devices[i], &handle);
      if (open_error != 0) continue;
      if (has_serial(handle, descriptor, address.serial)) {
        handle_ = handle;
        pipes_ = find_pipes(list.devices[i]);
      } else {
        libusb_close(handle);
      }
    }
    if (handle_ != nullptr) return;
    if (open_error == LIBUSB_ERROR_ACCESS) {
      throw InputError(usb_message(name_, open_error) + "; is the user in the group v3d?");
    }
    throw InstrumentAbsent("no such instrument on USB; lsusb lists the connected devices");
  }

  static bool has_serial(libusb_device_handle* handle, const libusb_device_descriptor& descriptor,
                         const std::string& serial) {
    if (serial.empty()) return true;
    std::array<unsigned char, 256> text{};
    const int n = libusb_get_string_descriptor_ascii(handle, descriptor.iSerialNumber, text.data(),
                                                     static_cast<int>(text.size()));
    return n > 0 && std::string(text.begin(), text.begin() + n) == serial;
  }

  void claim() {
    if (pipes_.interface < 0) throw InputError(name_ + ": is not a USBTMC instrument");
    libusb_set_auto_detach_kernel_driver(handle_, 1);
    const int error = libusb_claim_interface(handle_, pipes_.interface);
    if (error != 0) throw InstrumentError(usb_message("cannot be claimed", error));
  }

  const std::string name_;
  const Library library_;
  libusb_device_handle* handle_ = nullptr;
  Pipes pipes_;
};

}  // namespace

std::unique_ptr<UsbPort> open_usb_port(const StudioInstrument& address) {
  return std::make_unique<LibusbPort>(address);
}

}  // namespace v3d::trigger
