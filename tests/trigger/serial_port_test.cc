#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <termios.h>
#include <unistd.h>

#include <cstdlib>
#include <thread>

#include "support/fake_generator.h"
#include "support/message_of.h"
#include "trigger/scpi/instrument.h"
#include "trigger/scpi/scpi_generator.h"

namespace v3d::trigger {
namespace {

using testing::HasSubstr;

/// A fake BNC 575 at the other end of a pseudo-terminal.
class SerialBench {
 public:
  /// `answers` false: it reads commands without answers.
  explicit SerialBench(bool answers = true) : answers_(answers) {
    master_ = posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC);
    grantpt(master_);
    unlockpt(master_);
    device = ptsname(master_);
    held_ = open(device.c_str(), O_RDWR | O_NOCTTY | O_CLOEXEC);
    thread_ = std::thread([this] { serve(); });
  }
  ~SerialBench() { unplug(); }

  void unplug() {
    if (!thread_.joinable()) return;
    const uint64_t one = 1;
    [[maybe_unused]] const auto n = write(quit_, &one, sizeof one);
    thread_.join();
    close(quit_);
    close(held_);
    close(master_);
  }

  speed_t speed() const {
    termios settings{};
    tcgetattr(held_, &settings);
    return cfgetospeed(&settings);
  }

  std::filesystem::path device;
  test::FakeGenerator generator{"bnc575"};  ///< to be read after unplug()

 private:
  void serve() {
    std::string line;
    for (;;) {
      pollfd fds[] = {{quit_, POLLIN, 0}, {master_, POLLIN, 0}};
      poll(fds, 2, -1);
      if (fds[0].revents != 0) return;
      char c = 0;
      if (read(master_, &c, 1) != 1) return;
      if (c != '\n') {
        line += c;
        continue;
      }
      EXPECT_EQ(line.back(), '\r');
      line.pop_back();
      const auto answer = generator.process(line);
      line.clear();
      if (!answers_ || !answer) continue;
      const std::string text = *answer + "\r\n";
      ASSERT_EQ(write(master_, text.data(), text.size()), static_cast<ssize_t>(text.size()));
    }
  }

  const bool answers_;
  int master_ = -1;
  int held_ = -1;  ///< keeps the terminal open before the test opens the port
  int quit_ = eventfd(0, EFD_CLOEXEC);
  std::thread thread_;
};

TEST(SerialPort, programs_and_starts_a_bnc_575) {
  SerialBench bench;
  StudioTrigger trigger;
  trigger.kind = TriggerKind::kScpi;
  trigger.dialect = Dialect::kBnc575;
  trigger.instrument.device = bench.device;
  {
    ScpiGenerator generator(trigger);
    generator.arm({.rate_hz = 25, .width = std::chrono::milliseconds(1), .count = 100});
    generator.start();
    EXPECT_EQ(generator.fault(), "");
    generator.stop();
  }
  bench.unplug();
  EXPECT_THAT(bench.generator.received, testing::Contains(":PULSE0:BCO 100"));
  EXPECT_THAT(bench.generator.received, testing::Contains(":PULSE0:STATE ON"));
  EXPECT_FALSE(bench.generator.output_on());
}

TEST(SerialPort, has_the_speed_of_the_studio_file) {
  for (const auto& [baud, speed] : {std::pair(38'400, B38400), std::pair(115'200, B115200)}) {
    const SerialBench bench;
    const auto port = open_instrument({.device = bench.device, .baud = baud});
    EXPECT_EQ(bench.speed(), static_cast<speed_t>(speed));
    EXPECT_EQ(port->query("*IDN?"), "BNC,575-4,0001,2.4.1");
  }
}

TEST(SerialPort, reports_a_silent_or_unplugged_instrument_and_a_device_that_is_not_a_serial_port) {
  SerialBench silent(false);
  SerialPort port(silent.device, 115'200);
  const auto refusal = [&] {
    return test::message_of<InstrumentError>([&] { port.query("*IDN?"); });
  };
  EXPECT_EQ(refusal(), "does not answer");
  silent.unplug();
  EXPECT_EQ(refusal(), "was unplugged");
  EXPECT_THAT(
      test::message_of<InstrumentError>([] { SerialPort absent("/dev/nonexistent", 9600); }),
      HasSubstr("/dev/nonexistent"));
  EXPECT_EQ(test::message_of<InputError>([] { SerialPort null("/dev/null", 9600); }),
            "/dev/null: is not a serial port; expected one such as /dev/ttyUSB0");
}

TEST(SerialPort, that_the_unit_or_the_mode_of_its_file_forbids_has_advice_for_each) {
  EXPECT_THAT(open_advice(EPERM), HasSubstr("DeviceAllow="));
  EXPECT_THAT(open_advice(EACCES), HasSubstr("group dialout"));
}

TEST(SerialPort, that_another_program_uses_is_busy_and_needs_no_permission) {
  EXPECT_EQ(test::message_of<InstrumentBusy>([] { fail_to_open("/dev/ttyUSB0", EBUSY); }),
            "/dev/ttyUSB0: Device or resource busy; another program uses it, for example "
            "ModemManager");
  EXPECT_EQ(test::message_of<InputError>([] { fail_to_open("/dev/ttyUSB0", EMFILE); }),
            "/dev/ttyUSB0: Too many open files");
}

}  // namespace
}  // namespace v3d::trigger
