// repaired.<node>.txt: the pulses whose silhouettes a reconstruction node repaired before it made
// their live mesh, one decimal number a line. A line that ends with '-' was cut by a crash.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/io/file.h"
#include "take/take.h"

namespace v3d::take {

std::filesystem::path repaired_pulses_path(const TakePaths& paths, const std::string& node);
/// True for the name of such a file.
bool is_repaired_pulses(std::string_view name);

/// Appends pulses. A node that restarts in the take continues its file; no byte of it changes. The
/// file is not synced: it only describes mesh.v3d, which can be made again. One thread.
class RepairedPulsesWriter {
 public:
  /// Opens the file with the first pulse, so a take without repaired pulses has none.
  explicit RepairedPulsesWriter(std::filesystem::path path) : path_(std::move(path)) {}

  /// Fails with path and cause when the disk reports an error; the file may then lack the pulse.
  [[nodiscard]] io::Status add(int64_t pulse);

 private:
  io::Status open();
  io::Status append(const std::string& text);

  const std::filesystem::path path_;
  std::optional<io::File> file_;
  uint64_t end_ = 0;
};

/// The repaired pulses of all nodes, ascending, each once; empty where the take has no such file. A
/// line that a crash has cut is ignored. Throws InputError with path and line for other text, and
/// when a file cannot be read.
std::vector<int64_t> read_repaired_pulses(const TakePaths& paths);

}  // namespace v3d::take
