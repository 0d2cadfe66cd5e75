#include "trigger/scpi/instrument.h"

#include <fcntl.h>
#include <sys/ioctl.h>
#include <termios.h>

#include <boost/asio/buffer.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/read_until.hpp>
#include <boost/asio/serial_port.hpp>
#include <boost/asio/write.hpp>
#include <cerrno>
#include <chrono>
#include <cstring>

#include "trigger/scpi/usb_port.h"
#include "trigger/scpi/usbtmc.h"

namespace v3d::trigger {

std::unique_ptr<Instrument> open_instrument(const StudioInstrument& address) {
  if (!address.device.empty()) return std::make_unique<SerialPort>(address.device, address.baud);
  return std::make_unique<Usbtmc>(open_usb_port(address));
}

std::string open_advice(int error_number) {
  // The device filter of systemd (cgroup) gives EPERM, the mode of the file EACCES.
  if (error_number == EPERM) {
    return "does DeviceAllow= of the unit v3d-captured@.service allow this device?";
  }
  if (error_number == EACCES) return "is the user in the group dialout?";
  if (error_number == EBUSY) return "another program uses it, for example ModemManager";
  return "";
}

void fail_to_open(const std::filesystem::path& device, int error_number) {
  if (error_number == ENOTTY) {
    throw InputError(device.string() + ": is not a serial port; expected one such as /dev/ttyUSB0");
  }
  const std::string advice = open_advice(error_number);
  const std::string text =
      device.string() + ": " + std::strerror(error_number) + (advice.empty() ? "" : "; " + advice);
  switch (error_number) {
    case ENOENT:
    case ENXIO:
    case ENODEV:
    case EIO:
      throw InstrumentAbsent(text);
    case EBUSY:
      throw InstrumentBusy(text);
    default:
      throw InputError(text);
  }
}

std::string in_quotes(const std::string& answer) {
  constexpr size_t kMaxCharacters = 60;
  std::string text = "'";
  for (const char c : answer.substr(0, kMaxCharacters)) text += c >= ' ' && c <= '~' ? c : '?';
  return text + (answer.size() > kMaxCharacters ? "...'" : "'");
}

namespace asio = boost::asio;
using boost::system::error_code;

namespace {

constexpr std::chrono::seconds kTimeout{1};
constexpr size_t kMaxAnswerBytes = 4096;

}  // namespace

struct SerialPort::Connection {
  /// Runs the operation that was started, at most kTimeout. Throws InstrumentError(`late`) when it
  /// does not end in that time.
  void run(const char* late) {
    context.restart();
    context.run_for(kTimeout);
    if (context.stopped()) return;
    port.cancel();
    context.run();
    throw InstrumentError(late);
  }

  asio::io_context context{1};
  asio::serial_port port{context};
};

SerialPort::SerialPort(const std::filesystem::path& device, int baud)
    : connection_(std::make_unique<Connection>()) {
  asio::serial_port& port = connection_->port;
  error_code error;
  port.open(device, error);
  if (error) fail_to_open(device, error.value());
  fcntl(port.native_handle(), F_SETFD, FD_CLOEXEC);
  ioctl(port.native_handle(), TIOCEXCL);
  // A port opened by Asio has 8 data bits and no parity.
  try {
    port.set_option(asio::serial_port::baud_rate(static_cast<unsigned>(baud)));
    port.set_option(asio::serial_port::stop_bits(asio::serial_port::stop_bits::one));
    port.set_option(asio::serial_port::flow_control(asio::serial_port::flow_control::none));
  } catch (const boost::system::system_error&) {
    throw InputError(device.string() + ": cannot be set to " + std::to_string(baud) +
                     " baud, 8N1; expected a rate that the port has");
  }
}

SerialPort::~SerialPort() = default;

void SerialPort::write(const std::string& line) {
  // Discards late answers to earlier commands.
  tcflush(connection_->port.native_handle(), TCIFLUSH);
  const std::string text = line + "\r\n";
  error_code error;
  asio::async_write(connection_->port, asio::buffer(text),
                    [&](error_code result, size_t) { error = result; });
  connection_->run("does not accept commands");
  if (error) throw InstrumentAbsent("was unplugged");
}

std::string SerialPort::query(const std::string& line) {
  write(line);
  std::string answer;
  error_code error;
  size_t size = 0;
  asio::async_read_until(connection_->port, asio::dynamic_buffer(answer, kMaxAnswerBytes), '\n',
                         [&](error_code result, size_t bytes) {
                           error = result;
                           size = bytes;
                         });
  connection_->run("does not answer");
  if (error == asio::error::not_found) {
    throw InstrumentError("sends an answer without a line end");
  }
  if (error) throw InstrumentAbsent("was unplugged");
  answer.resize(size);
  while (!answer.empty() && (answer.back() == '\n' || answer.back() == '\r')) answer.pop_back();
  return answer;
}

}  // namespace v3d::trigger
