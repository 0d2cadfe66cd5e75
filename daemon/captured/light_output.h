// Lamps of the studio.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <filesystem>
#include <mutex>
#include <string>
#include <thread>

#include "base/config/studio_file.h"
#include "base/core/time.h"
#include "base/io/file.h"

namespace v3d::captured {

/// Sends the scenes of [lights] to the lamps, through the program v3d-lights. A thread of its own
/// starts the program, and again a second after its end. Any thread may call the functions; none
/// waits.
class LightOutput {
 public:
  /// Starts with the work light. `program`: path of v3d-lights. `end_timeout`: for its last line.
  LightOutput(const StudioLights& lights, std::filesystem::path program,
              std::chrono::milliseconds end_timeout = std::chrono::seconds(2));
  /// Leaves the work light on, if the lamps can be reached.
  ~LightOutput();
  LightOutput(const LightOutput&) = delete;
  LightOutput& operator=(const LightOutput&) = delete;

  enum class Scene { kWork, kTake };
  void show(Scene scene);
  /// False until StudioLights::settle_ms after the last change of the scene.
  bool is_settled() const;

  struct Status {
    bool is_connected = false;  ///< v3d-lights has a connection to olad
    std::string fault;          ///< one line; empty: none
    Scene scene = Scene::kWork;
  };
  Status status() const;

 private:
  /// The program, and the socket that is its input and output.
  struct Sender {
    pid_t process = -1;
    io::UniqueFd socket;
  };
  void run();
  io::Result<Sender> start() const;
  void serve(int socket);
  void end(Sender sender);
  bool send_scene(int socket);
  bool receive(int socket, std::string& text);
  bool wait(int socket, int timeout_ms) const;
  bool is_stopping() const;
  void set_state(bool is_connected, const std::string& fault);

  const StudioLights lights_;
  const std::filesystem::path program_;
  const std::chrono::milliseconds end_timeout_;
  const io::UniqueFd changed_;  ///< eventfd: show() or the destructor was called
  mutable std::mutex mutex_;    ///< guards the members below
  bool stopping_ = false, unsent_ = true;
  Status status_;
  MonotonicInstant settled_at_{};
  std::thread thread_;  ///< last member
};

}  // namespace v3d::captured
