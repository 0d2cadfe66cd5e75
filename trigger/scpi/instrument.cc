#include "trigger/scpi/instrument.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <termios.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <utility>

#include "trigger/scpi/usb_port.h"
#include "trigger/scpi/usbtmc.h"

namespace v3d::trigger {

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

namespace {

constexpr Duration kTimeout = std::chrono::seconds(1);
constexpr size_t kMaxAnswerBytes = 4096;

/// The termios constant of a speed.
speed_t speed_of(int baud) {
  static constexpr std::array<std::pair<int, speed_t>, 8> kSpeeds = {{{4800, B4800},
                                                                      {9600, B9600},
                                                                      {19'200, B19200},
                                                                      {38'400, B38400},
                                                                      {57'600, B57600},
                                                                      {115'200, B115200},
                                                                      {230'400, B230400},
                                                                      {460'800, B460800}}};
  for (const auto& [value, speed] : kSpeeds) {
    if (value == baud) return speed;
  }
  throw InputError(
      std::to_string(baud) +
      " baud is not supported; right would be 4800, 9600, 19200, 38400, 57600, 115200, "
      "230400 or 460800");
}

}  // namespace

SerialPort::SerialPort(const std::filesystem::path& device, int baud) {
  fd_ = open(device.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
  if (fd_ < 0) {
    const bool may_come = errno == ENOENT || errno == ENXIO || errno == ENODEV || errno == EIO;
    const std::string cause = errno_message(device.string());
    if (may_come) throw InstrumentAbsent(cause);
    throw InputError(cause + "; is the user in the group dialout?");
  }
  try {
    set_up(baud);
  } catch (...) {
    close(fd_);
    throw;
  }
}

SerialPort::~SerialPort() { close(fd_); }

void SerialPort::set_up(int baud) {
  termios settings{};
  if (tcgetattr(fd_, &settings) != 0) throw InputError("is not a serial port");
  cfmakeraw(&settings);
  settings.c_cflag &= ~static_cast<tcflag_t>(CSTOPB | CRTSCTS);
  settings.c_cflag |= CLOCAL | CREAD;
  cfsetispeed(&settings, speed_of(baud));
  cfsetospeed(&settings, speed_of(baud));
  if (tcsetattr(fd_, TCSANOW, &settings) != 0) {
    throw InputError("cannot be set to " + std::to_string(baud) + " baud, 8N1");
  }
  ioctl(fd_, TIOCEXCL);
}

bool SerialPort::wait_for(short events, MonotonicInstant deadline) const {
  const auto remaining_ms = (deadline - Monotonic::now()) / std::chrono::milliseconds(1);
  pollfd ready{fd_, events, 0};
  poll(&ready, 1, static_cast<int>(std::max<int64_t>(0, remaining_ms)));
  if ((ready.revents & (POLLERR | POLLHUP | POLLNVAL)) != 0) {
    throw InstrumentAbsent("was unplugged");
  }
  return (ready.revents & events) != 0;
}

void SerialPort::write(const std::string& line) {
  tcflush(fd_, TCIFLUSH);  // discards late answers to earlier commands
  const std::string text = line + "\r\n";
  const MonotonicInstant deadline = Monotonic::now() + kTimeout;
  for (size_t sent = 0; sent < text.size();) {
    if (!wait_for(POLLOUT, deadline)) throw InstrumentError("does not accept commands");
    const ssize_t n = ::write(fd_, text.data() + sent, text.size() - sent);
    if (n < 0 && errno != EAGAIN && errno != EINTR) throw InstrumentAbsent("was unplugged");
    sent += static_cast<size_t>(std::max<ssize_t>(0, n));
  }
}

std::string SerialPort::query(const std::string& line) {
  write(line);
  const MonotonicInstant deadline = Monotonic::now() + kTimeout;
  std::string answer;
  while (answer.empty() || answer.back() != '\n') {
    if (!wait_for(POLLIN, deadline)) throw InstrumentError("does not answer");
    char c = 0;
    const ssize_t n = read(fd_, &c, 1);
    if (n == 0 || (n < 0 && errno != EAGAIN && errno != EINTR)) {
      throw InstrumentAbsent("was unplugged");
    }
    if (n == 1) answer += c;
    if (answer.size() > kMaxAnswerBytes)
      throw InstrumentError("sends an answer without a line end");
  }
  while (!answer.empty() && (answer.back() == '\n' || answer.back() == '\r')) answer.pop_back();
  return answer;
}

}  // namespace v3d::trigger
