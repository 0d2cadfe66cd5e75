#include "v3dctl/reconstruct/shard_folder.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <span>

#include "base/checksum.h"
#include "base/error.h"
#include "base/file.h"
#include "base/io/uninterrupted.h"
#include "codec/frame_codec.h"
#include "take/log_segments.h"
#include "take/mesh_file.h"
#include "v3dctl/process.h"

namespace v3d::ctl {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr char kPrefix[] = ".pieces-";

std::span<const uint8_t> bytes_of(const std::string& text) {
  return {reinterpret_cast<const uint8_t*>(text.data()), text.size()};
}

std::string hex(uint64_t value) {
  char text[17];
  std::snprintf(text, sizeof text, "%016llx", static_cast<unsigned long long>(value));
  return text;
}

std::string checksum_of(std::initializer_list<std::span<const uint8_t>> parts) {
  return hex(checksum(parts));
}

/// The version, and the program itself: one that was built anew may make other bytes.
std::string this_program() {
  return V3D_VERSION " " + checksum_of({bytes_of(read_file("/proc/self/exe"))});
}

/// A file that the result depends on. Recordings are too large to be read for this.
Json input(const fs::path& path, const fs::path& folder) {
  std::error_code absent;
  const uintmax_t bytes = fs::file_size(path, absent);
  if (absent) return {path.lexically_relative(folder).string(), nullptr};
  const auto changed = fs::last_write_time(path).time_since_epoch();
  return {path.lexically_relative(folder).string(), bytes,
          std::chrono::duration_cast<std::chrono::nanoseconds>(changed).count()};
}

Json inputs_of(const TakeFrames& take) {
  const TakePaths& paths = take.paths();
  Json list = Json::array();
  const auto add = [&](const fs::path& path) { list.push_back(input(path, paths.folder)); };
  const auto add_log = [&](const fs::path& log) {
    for (const fs::path& segment : io::value_or_throw(existing_segments(log))) {
      add(segment);
      add(segment_index_path(segment));
    }
  };
  for (const fs::path& path : {paths.info(), paths.calib()}) add(path);
  add_log(paths.pulses());
  for (const RigCamera& camera : take.rig()) {
    add_log(paths.frames(camera.name));
    for (const char* end : {".mean.png", ".spread.png", ".toml"}) {
      add(paths.background() / (camera.name + end));
    }
  }
  return list;
}

Json deform_to_json(const DeformOptions& deform) {
  return {{"mode", static_cast<int>(deform.mode)},
          {"internal", deform.internal},
          {"photometric", deform.photometric},
          {"silhouette", deform.silhouette},
          {"window", deform.window},
          {"views", deform.views},
          {"hollows", deform.hollows}};
}

DeformOptions deform_of(const Json& json) {
  DeformOptions deform;
  deform.mode = static_cast<DeformMode>(json.at("mode").get<int>());
  deform.internal = json.at("internal");
  deform.photometric = json.at("photometric");
  deform.silhouette = json.at("silhouette");
  deform.window = json.at("window");
  deform.views = json.at("views");
  deform.hollows = json.at("hollows");
  return deform;
}

Json to_json(const ReconstructRequest& settled) {
  const Box& box = *settled.bounds;
  return {
      {"bounds_m", {box.min.x(), box.min.y(), box.min.z(), box.max.x(), box.max.y(), box.max.z()}},
      {"voxel_m", *settled.voxel_m},
      {"min_views", *settled.min_views},
      {"quality", static_cast<int>(*settled.quality)},
      {"deform", deform_to_json(settled.deform)},
      {"steady", settled.steady},
      {"mend", settled.mend},
      {"frames", {settled.frames.begin, settled.frames.end}},
      {"leave_out", settled.leave_out}};
}

ReconstructRequest request_of(const Json& json) {
  ReconstructRequest request;
  const auto box = json.at("bounds_m").get<std::array<double, 6>>();
  request.bounds = Box{{box[0], box[1], box[2]}, {box[3], box[4], box[5]}};
  request.voxel_m = json.at("voxel_m").get<double>();
  request.min_views = json.at("min_views").get<int>();
  request.quality = static_cast<Quality>(json.at("quality").get<int>());
  request.deform = deform_of(json.at("deform"));
  request.steady = json.at("steady");
  request.mend = json.at("mend");
  request.frames.begin = json.at("frames").at(0);
  request.frames.end = json.at("frames").at(1);
  request.leave_out = json.at("leave_out").get<std::vector<std::string>>();
  return request;
}

std::string name_of(const Piece& piece, const char* end) {
  char text[40];
  std::snprintf(text, sizeof text, "piece-%06lld%s", static_cast<long long>(piece.number), end);
  return text;
}

/// Another for every process of every host.
std::string own_ending() { return host_name() + "-" + std::to_string(getpid()); }

std::vector<fs::path> entries_of(const fs::path& folder, const std::string& prefix) {
  std::vector<fs::path> entries;
  std::error_code gone;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, gone)) {
    if (entry.path().filename().string().starts_with(prefix)) entries.push_back(entry.path());
  }
  return entries;
}

}  // namespace

std::vector<Piece> pieces_of(const std::vector<int64_t>& pulses) {
  const int64_t length = EncoderOptions().key_every;
  std::vector<Piece> pieces;
  for (const int64_t pulse : pulses) {
    if (pieces.empty() || pieces.back().number != pulse / length) {
      pieces.push_back({pulse / length, {}});
    }
    pieces.back().pulses.push_back(pulse);
  }
  return pieces;
}

PieceFolder PieceFolder::of(const ReconstructRequest& settled, const TakeFrames& take) {
  const Json order = {
      {"program", this_program()}, {"request", to_json(settled)}, {"inputs", inputs_of(take)}};
  const std::string text = order.dump(1);
  const fs::path take_folder = fs::canonical(take.paths().folder);
  PieceFolder folder(take_folder / (kPrefix + checksum_of({bytes_of(text)})));
  std::error_code error;
  fs::create_directory(folder.path(), error);
  if (error) throw std::runtime_error(folder.path().string() + ": " + error.message());
  replace_file(folder.path() / "order.json", text);
  return folder;
}

std::string PieceFolder::digest() const {
  return path_.filename().string().substr(sizeof kPrefix - 1);
}

ReconstructRequest PieceFolder::order() const {
  const fs::path path = path_ / "order.json";
  try {
    const Json order = Json::parse(read_file(path));
    if (order.at("program") != this_program()) {
      throw InputError(host_name() +
                       " has another v3dctl than the one that ordered the pieces in " +
                       path_.string() + ": install the same version on all nodes");
    }
    ReconstructRequest request = request_of(order.at("request"));
    request.take = path_.parent_path();
    return request;
  } catch (const Json::exception&) {
    throw InputError(path.string() + ": is no order of v3dctl reconstruct");
  }
}

fs::path PieceFolder::mesh(const Piece& piece) const { return path_ / name_of(piece, ".v3d"); }
fs::path PieceFolder::report(const Piece& piece) const { return path_ / name_of(piece, ".json"); }

void PieceFolder::save(const Piece& piece, const ReconstructReport& report) const {
  const Json samples = samples_to_json(report);
  const std::string sum = checksum_of({bytes_of(read_file(mesh(piece))), bytes_of(samples.dump())});
  replace_file(this->report(piece), Json{{"checksum", sum}, {"samples", samples}}.dump());
}

std::optional<ReconstructReport> PieceFolder::find(const Piece& piece,
                                                   const ReconstructReport& begun) const {
  if (!fs::exists(report(piece)) || !fs::exists(mesh(piece))) return std::nullopt;
  try {
    const Json json = Json::parse(read_file(report(piece)));
    const Json& samples = json.at("samples");
    const std::string sum =
        checksum_of({bytes_of(read_file(mesh(piece))), bytes_of(samples.dump())});
    if (json.at("checksum") != sum || MeshFileReader(mesh(piece)).pulses() != piece.pulses) {
      return std::nullopt;
    }
    ReconstructReport found = begun;
    read_samples(samples, found);
    return found;
  } catch (const Json::exception&) {
    return std::nullopt;
  } catch (const InputError&) {
    return std::nullopt;
  }
}

void PieceFolder::drop(const Piece& piece) const {
  std::error_code absent;
  fs::remove(report(piece), absent);
  fs::remove(mesh(piece), absent);
}

std::set<int64_t> PieceFolder::saved() const {
  std::set<int64_t> numbers;
  for (const fs::path& path : entries_of(path_, "piece-")) {
    long long number = -1;
    if (path.extension() != ".json") continue;
    if (std::sscanf(path.filename().c_str(), "piece-%lld.json", &number) == 1) {
      numbers.insert(number);
    }
  }
  return numbers;
}

void PieceFolder::refuse(const std::string& reason) const {
  replace_file(path_ / ("refused-" + own_ending()), reason);
}

std::optional<std::string> PieceFolder::refusal() const {
  for (const fs::path& path : entries_of(path_, "refused-")) {
    if (path.string().find(".own-") == std::string::npos) return read_file(path);
  }
  return std::nullopt;
}

void PieceFolder::forget_refusals() const {
  std::error_code ignored;
  for (const fs::path& path : entries_of(path_, "refused-")) fs::remove(path, ignored);
}

void PieceFolder::remove() const {
  std::error_code ignored;
  fs::remove_all(path_, ignored);
}

void PieceFolder::remove_others() const {
  for (const fs::path& path : entries_of(path_.parent_path(), kPrefix)) {
    if (path == path_) continue;
    const PieceFolder other(path);
    if (PieceFolderLock(other).state() == PieceFolderLock::State::kHeld) other.remove();
  }
}

PieceFolderLock::PieceFolderLock(const PieceFolder& folder) {
  const fs::path path = folder.path() / "lock";
  fd_ = io::uninterrupted([&] { return open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644); });
  if (fd_ < 0) {
    error_ = errno_message(path.string());
  } else if (flock(fd_, LOCK_EX | LOCK_NB) == 0) {
    state_ = State::kHeld;
  } else if (errno == EWOULDBLOCK) {
    state_ = State::kHeldByAnother;
  }
}

PieceFolderLock::~PieceFolderLock() {
  if (fd_ >= 0) close(fd_);
}

}  // namespace v3d::ctl
