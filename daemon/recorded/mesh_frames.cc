#include "daemon/recorded/mesh_frames.h"

#include <algorithm>

#include "base/core/error.h"
#include "base/io/whole_file.h"
#include "codec/frame_header.h"

namespace v3d {
namespace {

std::filesystem::path mesh_of(const TakePaths& paths, const std::filesystem::path& file) {
  load_take_info(paths);  // throws if the folder is not a take
  if (!file_exists(file)) {
    throw InputError(file.string() + ": is not there: run v3dctl reconstruct " +
                     paths.folder.string() + " first");
  }
  return file;
}

std::string text_of(FrameRange range) {
  std::string text = std::to_string(range.begin) + ":";
  if (range.end != FrameRange{}.end) text += std::to_string(range.end);
  return text;
}

}  // namespace

MeshFrames::MeshFrames(const std::filesystem::path& take)
    : MeshFrames(take, TakePaths{take}.mesh()) {}

MeshFrames::MeshFrames(const std::filesystem::path& take, const std::filesystem::path& file)
    : path_(mesh_of({take}, file)), file_(path_) {}

std::vector<int64_t> MeshFrames::frames(FrameRange range) const {
  const std::vector<int64_t>& all = file_.pulses();
  if (all.empty()) throw InputError(path_.string() + ": holds no frames");
  std::vector<int64_t> frames;
  std::copy_if(all.begin(), all.end(), std::back_inserter(frames),
               [&](int64_t frame) { return range.contains(frame); });
  if (frames.empty()) {
    throw InputError("--frames " + text_of(range) + ": " + path_.string() + " has frames " +
                     std::to_string(all.front()) + " to " + std::to_string(all.back()));
  }
  return frames;
}

CompactFrame MeshFrames::read(int64_t frame) {
  frames({frame, frame + 1});
  const auto bytes = io::value_or_throw(file_.read(frame));
  const auto header = bytes ? read_header(*bytes) : std::nullopt;
  if (!header) throw_damaged(frame);
  DecodeStatus status = decoder_.decode(*bytes);
  if (status == DecodeStatus::kNeedsReference) {
    for (const int64_t before : file_.pulses()) {
      if (before >= header->key_pulse && before < frame) decode(before);
    }
    status = decoder_.decode(*bytes);
  }
  if (status != DecodeStatus::kOk) throw_damaged(frame);
  return decoder_.frame();
}

void MeshFrames::decode(int64_t frame) {
  const auto bytes = io::value_or_throw(file_.read(frame));
  if (!bytes || decoder_.decode(*bytes) != DecodeStatus::kOk) throw_damaged(frame);
}

void MeshFrames::throw_damaged(int64_t frame) const {
  throw InputError(path_.string() + ": frame " + std::to_string(frame) +
                   " is damaged, or of an earlier version: reconstruct the take again");
}

}  // namespace v3d
