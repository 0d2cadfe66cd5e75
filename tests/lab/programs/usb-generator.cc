// usb-generator FFS PULL DIALECT [FAULT]: simulated signal generator on USB (USBTMC on FunctionFS),
// whose output is the pull of an input of gpio-sim.
//   FFS     folder of the mounted FunctionFS
//   PULL    file of the pull in sysfs
//   FAULT   "nonsense" answers with bytes that are not USBTMC, "stall" stalls the third request,
//   "slow"
//           answers after two seconds, "dies" exits at the tenth command, "miscounts" makes one
//           pulse less than commanded, "fails:N" exits after N pulses
// Prints "ready" when it can be plugged in, and at SIGTERM the number of pulses that it has made.
#include <endian.h>
#include <fcntl.h>
#include <linux/usb/functionfs.h>
#include <sched.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <ctime>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "support/fake_generator.h"

namespace {

struct Function {
  usb_interface_descriptor interface;
  usb_endpoint_descriptor_no_audio out;
  usb_endpoint_descriptor_no_audio in;
} __attribute__((packed));

struct Descriptors {
  usb_functionfs_descs_head_v2 head;
  __le32 full_speed_count;
  __le32 high_speed_count;
  Function full_speed;
  Function high_speed;
} __attribute__((packed));

struct Strings {
  usb_functionfs_strings_head head;
  __le16 language;
  char name[10];
} __attribute__((packed));

Function function_of(uint16_t packet) {
  Function f{};
  f.interface.bLength = sizeof f.interface;
  f.interface.bDescriptorType = USB_DT_INTERFACE;
  f.interface.bNumEndpoints = 2;
  f.interface.bInterfaceClass = 0xFE;
  f.interface.bInterfaceSubClass = 3;
  f.interface.iInterface = 1;
  f.out.bLength = sizeof f.out;
  f.out.bDescriptorType = USB_DT_ENDPOINT;
  f.out.bEndpointAddress = 1 | USB_DIR_OUT;
  f.out.bmAttributes = USB_ENDPOINT_XFER_BULK;
  f.out.wMaxPacketSize = htole16(packet);
  f.in = f.out;
  f.in.bEndpointAddress = 2 | USB_DIR_IN;
  return f;
}

int open_or_die(const std::string& path, int flags) {
  const int fd = open(path.c_str(), flags);
  if (fd >= 0) return fd;
  std::perror(path.c_str());
  std::exit(1);
}

template <class T>
void write_or_die(int fd, const T& what) {
  if (write(fd, &what, sizeof what) == static_cast<ssize_t>(sizeof what)) return;
  std::perror("descriptors");
  std::exit(1);
}

int describe(const std::string& folder) {
  const int control = open_or_die(folder + "/ep0", O_RDWR);
  Descriptors descriptors{};
  descriptors.head.magic = htole32(FUNCTIONFS_DESCRIPTORS_MAGIC_V2);
  descriptors.head.flags = htole32(FUNCTIONFS_HAS_FS_DESC | FUNCTIONFS_HAS_HS_DESC);
  descriptors.head.length = htole32(sizeof descriptors);
  descriptors.full_speed_count = descriptors.high_speed_count = htole32(3);
  descriptors.full_speed = function_of(64);
  descriptors.high_speed = function_of(512);
  write_or_die(control, descriptors);
  Strings strings{};
  strings.head.magic = htole32(FUNCTIONFS_STRINGS_MAGIC);
  strings.head.length = htole32(sizeof strings);
  strings.head.str_count = strings.head.lang_count = htole32(1);
  strings.language = htole16(0x409);
  std::strcpy(strings.name, "generator");
  write_or_die(control, strings);
  return control;
}

/// Answers the control requests of the USBTMC class; each succeeds at once. Stalls other requests.
void serve_control(int control) {
  usb_functionfs_event event{};
  while (read(control, &event, sizeof event) == static_cast<ssize_t>(sizeof event)) {
    if (event.type != FUNCTIONFS_SETUP) continue;
    const usb_ctrlrequest& request = event.u.setup;
    uint8_t answer[24] = {1};
    const bool of_class = (request.bRequestType & USB_TYPE_MASK) == USB_TYPE_CLASS;
    const size_t size = std::min<size_t>(sizeof answer, le16toh(request.wLength));
    ssize_t done = 0;
    if (!of_class || request.bRequest > 7) {  // a transfer in the opposite direction stalls
      done = (request.bRequestType & USB_DIR_IN) != 0 ? read(control, answer, 0)
                                                      : write(control, answer, 0);
    } else {
      done = write(control, answer, size);
    }
    if (done < 0 && errno != EL2HLT) std::perror("ep0");
  }
}

/// The output: a thread that makes pulses on the pull of a line.
class Output {
 public:
  /// Exits the program after `max_pulses` pulses; -1: no limit.
  Output(int pull, int64_t max_pulses)
      : pull_(pull), max_pulses_(max_pulses), thread_([this] { run(); }) {}
  ~Output() {
    quit_ = true;
    thread_.join();
  }
  Output(const Output&) = delete;
  Output& operator=(const Output&) = delete;

  void make(int64_t count, double rate_hz, double width_s) {
    const std::lock_guard lock(mutex_);
    count_ = count;
    period_ns_ = static_cast<int64_t>(1e9 / rate_hz);
    width_ns_ = static_cast<int64_t>(1e9 * width_s);
  }
  void stop() {
    const std::lock_guard lock(mutex_);
    count_ = 0;
  }
  int64_t made() const { return made_; }

 private:
  static timespec now() {
    timespec t{};
    clock_gettime(CLOCK_MONOTONIC, &t);
    return t;
  }
  static void sleep_until(timespec& t, int64_t plus_ns) {
    const int64_t ns = t.tv_nsec + plus_ns;
    t = {t.tv_sec + ns / 1'000'000'000, ns % 1'000'000'000};
    clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &t, nullptr);
  }
  void set(const char* pull) const {
    if (pwrite(pull_, pull, std::strlen(pull), 0) < 0) std::perror("pull");
  }
  void run() {
    sched_param priority{};
    priority.sched_priority = 50;
    pthread_setschedparam(pthread_self(), SCHED_FIFO, &priority);
    for (timespec at = now(); !quit_;) {
      int64_t period = 0;
      int64_t width = 0;
      {
        const std::lock_guard lock(mutex_);
        if (count_ != 0) period = period_ns_;
        width = width_ns_;
        if (count_ > 0) --count_;
      }
      if (period == 0) {
        at = now();
        sleep_until(at, 1'000'000);
        continue;
      }
      set("pull-up");
      sleep_until(at, width);
      set("pull-down");
      if (++made_ == max_pulses_) _exit(0);
      sleep_until(at, period - width);
    }
  }

  const int pull_;
  const int64_t max_pulses_;
  std::mutex mutex_;
  int64_t count_ = 0;  ///< remaining pulses; -1: without end
  int64_t period_ns_ = 0;
  int64_t width_ns_ = 0;
  std::atomic<int64_t> made_ = 0;
  std::atomic<bool> quit_ = false;
  std::thread thread_;
};

/// The bulk endpoints: USBTMC messages that carry command lines of the dialect.
class Messages {
 public:
  Messages(const std::string& folder, const std::string& dialect, std::string fault, Output& output)
      : out_(open_or_die(folder + "/ep1", O_RDWR)),
        in_(open_or_die(folder + "/ep2", O_RDWR)),
        generator_(dialect),
        fault_(std::move(fault)),
        output_(output) {}

  void serve() {
    uint8_t bytes[1024];
    for (;;) {
      const ssize_t n = read(out_, bytes, sizeof bytes);
      if (n >= 12 && bytes[0] == 1) command(bytes, static_cast<size_t>(n));
      if (n >= 12 && bytes[0] == 2) answer(bytes[1]);
      if (n < 0 && errno != EINTR) usleep(10'000);  // unplugged
    }
  }

 private:
  void command(const uint8_t* bytes, size_t n) {
    if (fault_ == "dies" && ++commands_ == 10) _exit(0);
    const size_t announced = bytes[4] | bytes[5] << 8;
    std::string line(reinterpret_cast<const char*>(bytes) + 12, std::min(announced, n - 12));
    while (!line.empty() && line.back() == '\n') line.pop_back();
    if (line.empty()) return;
    const int64_t before = generator_.pulses;
    answer_ = generator_.process(line).value_or("");
    if (generator_.pulses == before) return;
    const int64_t less = fault_ == "miscounts" && generator_.pulses > 0 ? 1 : 0;
    if (generator_.pulses == 0) {
      output_.stop();
    } else {
      output_.make(generator_.pulses - less, generator_.rate_hz(), generator_.width_s());
    }
  }

  void answer(uint8_t tag) {
    ++requests_;
    if (fault_ == "slow") sleep(2);
    if (fault_ == "stall" && requests_ == 3) {
      uint8_t none = 0;
      if (read(in_, &none, 1) < 0 && errno != EBADMSG) std::perror("stall");
      return;
    }
    const std::string text = answer_ + "\n";
    std::vector<uint8_t> bytes(12 + (text.size() + 3) / 4 * 4, 0);
    if (fault_ == "nonsense") {
      bytes.assign(64, 0xA5);
    } else {
      bytes[0] = 2;
      bytes[1] = tag;
      bytes[2] = static_cast<uint8_t>(~tag);
      bytes[4] = static_cast<uint8_t>(text.size());
      bytes[5] = static_cast<uint8_t>(text.size() >> 8);
      bytes[8] = 1;
      std::memcpy(&bytes[12], text.data(), text.size());
    }
    if (write(in_, bytes.data(), bytes.size()) < 0) std::perror("answer");
  }

  const int out_;
  const int in_;
  v3d::test::FakeGenerator generator_;
  const std::string fault_;
  Output& output_;
  std::string answer_;
  int64_t commands_ = 0;
  int64_t requests_ = 0;
};

}  // namespace

int main(int argc, char** argv) {
  if (argc < 4) return 2;
  sigset_t end;
  sigemptyset(&end);
  sigaddset(&end, SIGTERM);
  sigprocmask(SIG_BLOCK, &end, nullptr);
  const std::string folder = argv[1];
  const std::string fault = argc > 4 ? argv[4] : "";
  const int64_t max_pulses = fault.rfind("fails:", 0) == 0 ? std::stoll(fault.substr(6)) : -1;
  Output output(open_or_die(argv[2], O_WRONLY), max_pulses);
  const int control = describe(folder);
  std::thread([control] { serve_control(control); }).detach();
  Messages messages(folder, argv[3], fault, output);
  std::thread([&messages] { messages.serve(); }).detach();
  std::printf("ready\n");
  std::fflush(stdout);
  int signal = 0;
  sigwait(&end, &signal);
  std::printf("%lld\n", static_cast<long long>(output.made()));
  std::fflush(stdout);
  _exit(0);
}
