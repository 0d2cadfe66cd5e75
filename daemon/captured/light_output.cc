#include "daemon/captured/light_output.h"

#include <fmt/ranges.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <utility>

#include "base/io/file.h"
#include "base/io/process.h"

namespace v3d::captured {
namespace {

constexpr int kRestartAfterMs = 1000;
constexpr int kNoTimeout = -1;
constexpr size_t kMaxText = 4096;  ///< of lines from the program

}  // namespace

LightOutput::LightOutput(const StudioLights& lights, std::filesystem::path program,
                         std::chrono::milliseconds end_timeout)
    : lights_(lights),
      program_(std::move(program)),
      end_timeout_(end_timeout),
      changed_(eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)),
      thread_([this] { run(); }) {}

LightOutput::~LightOutput() {
  show(Scene::kWork);
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  eventfd_write(changed_.get(), 1);
  thread_.join();
}

void LightOutput::show(Scene scene) {
  {
    const std::lock_guard lock(mutex_);
    if (status_.scene == scene) return;
    status_.scene = scene;
    settled_at_ = Monotonic::now() + from_seconds(lights_.settle_ms * 1e-3);
    unsent_ = true;
  }
  eventfd_write(changed_.get(), 1);
}

bool LightOutput::is_settled() const {
  const std::lock_guard lock(mutex_);
  return Monotonic::now() >= settled_at_;
}

LightOutput::Status LightOutput::status() const {
  const std::lock_guard lock(mutex_);
  return status_;
}

void LightOutput::run() {
  while (!is_stopping()) {
    if (auto sender = start()) {
      serve(sender->socket.get());
      end(*std::move(sender));
    } else {
      set_state(false, sender.error().message);
    }
    for (bool woken = true; woken && !is_stopping();) woken = wait(-1, kRestartAfterMs);
  }
}

io::Result<LightOutput::Sender> LightOutput::start() const {
  std::array<int, 2> ends{-1, -1};
  if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends.data()) != 0) {
    return io::io_error("start", program_);
  }
  Sender sender{.socket = io::UniqueFd(ends[0])};
  const io::UniqueFd other(ends[1]);
  sender.process =
      spawn_process({program_, "--universe", std::to_string(lights_.universe)},
                    {.input = other.get(), .output = other.get(), .errors = other.get()});
  if (sender.process < 0) return io::io_error("start", program_);
  return sender;
}

/// Sends each change of the scene until the program ends or this thread has to end.
void LightOutput::serve(int socket) {
  {
    const std::lock_guard lock(mutex_);
    unsent_ = true;
  }
  for (std::string text; send_scene(socket) && !is_stopping();) {
    if (wait(socket, kNoTimeout) && !receive(socket, text)) return;
  }
}

/// Lets the program send its last line and end.
void LightOutput::end(Sender sender) {
  shutdown(sender.socket.get(), SHUT_WR);
  std::string text;
  pollfd ready{sender.socket.get(), POLLIN, 0};
  while (poll(&ready, 1, static_cast<int>(end_timeout_.count())) > 0 && receive(ready.fd, text)) {
  }
  kill_process(sender.process);
  const std::lock_guard lock(mutex_);
  status_.is_connected = false;
  if (status_.fault.empty() && !stopping_) status_.fault = "v3d-lights has ended";
}

/// False when the program has closed its end.
bool LightOutput::send_scene(int socket) {
  std::string line;
  {
    const std::lock_guard lock(mutex_);
    if (!std::exchange(unsent_, false)) return true;
    const auto& values = status_.scene == Scene::kTake ? lights_.take : lights_.work;
    line = fmt::format("{}\n", fmt::join(values, " "));
  }
  return send(socket, line.data(), line.size(), MSG_NOSIGNAL) == static_cast<ssize_t>(line.size());
}

/// Reads lines of the program: "connected" or its fault. False at its end.
bool LightOutput::receive(int socket, std::string& text) {
  std::array<char, 512> part{};
  const ssize_t got = read(socket, part.data(), part.size());
  if (got <= 0 || text.size() > kMaxText) return false;
  text.append(part.data(), static_cast<size_t>(got));
  for (size_t end = 0; (end = text.find('\n')) != std::string::npos; text.erase(0, end + 1)) {
    const std::string line = text.substr(0, end);
    const bool is_connected = line == "connected";
    set_state(is_connected, is_connected ? "" : line);
  }
  return true;
}

/// Waits for the program, a change or the end. True when the program has written or has ended; for
/// the socket -1: true when it was woken before the time.
bool LightOutput::wait(int socket, int timeout_ms) const {
  std::array<pollfd, 2> ready{{{changed_.get(), POLLIN, 0}, {socket, POLLIN, 0}}};
  if (poll(ready.data(), ready.size(), timeout_ms) <= 0) return false;
  eventfd_t count = 0;
  const bool is_changed = eventfd_read(changed_.get(), &count) == 0;
  return socket < 0 ? is_changed : ready[1].revents != 0;
}

bool LightOutput::is_stopping() const {
  const std::lock_guard lock(mutex_);
  return stopping_;
}

void LightOutput::set_state(bool is_connected, const std::string& fault) {
  const std::lock_guard lock(mutex_);
  status_.is_connected = is_connected;
  status_.fault = fault;
}

}  // namespace v3d::captured
