#include "v3dctl/export/take_export.h"

#include <fmt/core.h>

#include <algorithm>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "base/core/error.h"
#include "base/io/child_process.h"
#include "base/io/file.h"
#include "base/io/process.h"
#include "common/console.h"
#include "common/partial_file.h"
#include "daemon/recorded/mesh_frames.h"
#include "sound/wave_file.h"
#include "take/ledger/ledger.h"
#include "take/take_sound.h"
#include "v3dctl/export/mesh_export.h"
#include "v3dctl/export/surface_sequence.h"
#include "v3dctl/export/training_pulse.h"
#include "v3dctl/options.h"

namespace v3d::ctl {
namespace {

namespace fs = std::filesystem;

bool is_training(TakeFormat format) {
  return format == TakeFormat::kColmap || format == TakeFormat::kNerfstudio;
}

const char* name_of(TakeFormat format) {
  switch (format) {
    case TakeFormat::kGlbSequence:
      return "glb-sequence";
    case TakeFormat::kUsda:
      return "usda";
    case TakeFormat::kColmap:
      return "colmap";
    case TakeFormat::kNerfstudio:
      return "nerfstudio";
  }
  return "";
}

void check_request(const TakeExport& request) {
  const std::string option = std::string("--format ") + name_of(request.format);
  if (is_training(request.format)) {
    const std::string rule = ": expected --format ply, obj, glb, glb-sequence or usda";
    if (request.performer > 0) throw InputError("--performer" + rule);
    if (request.surface == Surface::kProxy) throw InputError("--proxy" + rule);
    if (request.surface != Surface::kAutomatic) {
      throw InputError("--surface: expected --format glb-sequence or usda");
    }
    return;
  }
  const char* ending = request.format == TakeFormat::kUsda ? ".usda" : ".glb";
  if (request.out.extension() != ending) {
    throw InputError(request.out.string() + ": " + option + " expects the name of a " + ending +
                     " file");
  }
  if (request.performer > 0 && request.surface == Surface::kTracked) {
    throw InputError(
        "--performer: tracked surfaces state no performers; expected --surface meshes");
  }
}

void create_folder_of(const fs::path& out) {
  if (const io::Status made = io::create_folders(fs::absolute(out).parent_path()); !made) {
    io::throw_input_error(made.error());
  }
}

/// Throws where `file` cannot be written. Its content, which is made in memory, takes minutes.
void require_writable(const fs::path& file) {
  create_folder_of(file);
  const PartialFile trial(file);
  io::throw_if_failed(io::replace_file(trial.path(), ""));
}

int export_training(const TakeExport& request, recorded::MeshFrames& meshes,
                    const std::vector<int64_t>& pulses) {
  const bool colmap = request.format == TakeFormat::kColmap;
  TrainingPulses training(request.take, std::string("--format ") + name_of(request.format));
  create_folder_of(request.out);
  PartialFolder folder(request.out);
  Progress progress("export", std::ssize(pulses));
  for (const int64_t pulse : pulses) {
    stop_if_interrupted();
    const fs::path place =
        pulses.size() == 1 ? folder.path() : folder.path() / fmt::format("{:06}", pulse);
    io::throw_if_failed(io::create_folders(place));
    const TrainingPulse content = training.of(meshes.read(pulse));
    colmap ? write_colmap(place, content) : write_nerfstudio(place, content);
    progress.advance();
  }
  folder.finish();
  return report_incomplete_frames(training.incomplete(), request.take);
}

int export_sequence(const TakeExport& request, const take::TakeInfo& info,
                    recorded::MeshFrames& meshes, const std::vector<int64_t>& pulses) {
  require_writable(request.out);
  const take::TakeTimecode timecodes({request.take});
  SequenceOptions options{info.name, info.rate_hz,
                          [&](int64_t pulse) { return timecodes.at(pulse); }};
  options.max_usda_bytes = static_cast<uint64_t>(available_memory()) / 4;
  const std::unique_ptr<SurfaceSequence> sequence = request.format == TakeFormat::kUsda
                                                        ? make_usda_sequence(options)
                                                        : make_glb_sequence(options);
  PerformerFilter performer(request.take, request.performer);
  std::vector<ExportedCamera> no_cameras;
  Progress progress("export", std::ssize(pulses));
  for (const int64_t pulse : pulses) {
    stop_if_interrupted();
    recon::CompactFrame content = meshes.read(pulse);
    performer.apply(content, no_cameras);
    sequence->add(pulse, content.mesh);
    progress.advance();
  }
  performer.require_present();
  replace_file(request.out, sequence->finish());
  return kExitDone;
}

/// The file with the surfaces.
fs::path surfaces_of(const TakeExport& request) {
  const take::TakePaths paths{request.take};
  if (request.surface == Surface::kProxy) return paths.proxy();
  const bool can_be_tracked = !is_training(request.format) && request.performer == 0;
  const bool tracked =
      request.surface == Surface::kTracked ||
      (request.surface == Surface::kAutomatic && can_be_tracked && file_exists(paths.motion()));
  if (!tracked) return paths.mesh();
  if (!file_exists(paths.motion())) {
    load_take_info(paths);  // throws if the folder is not a take
    throw InputError(paths.motion().string() + ": is not there: run v3dctl track " +
                     request.take.string() + " first");
  }
  note("v3dctl: exports the tracked surfaces of " + paths.motion().string());
  return paths.motion();
}

}  // namespace

std::optional<TakeFormat> parse_take_format(std::string_view text) {
  for (const TakeFormat format : {TakeFormat::kGlbSequence, TakeFormat::kUsda, TakeFormat::kColmap,
                                  TakeFormat::kNerfstudio}) {
    if (text == name_of(format)) return format;
  }
  return std::nullopt;
}

Surface parse_surface(std::string_view text) {
  if (text == "automatic") return Surface::kAutomatic;
  if (text == "meshes") return Surface::kMeshes;
  if (text == "tracked") return Surface::kTracked;
  throw InputError("--surface " + std::string(text) + ": expected automatic, meshes or tracked");
}

int export_take(const TakeExport& request) {
  check_request(request);
  recorded::MeshFrames meshes(request.take, surfaces_of(request));
  const std::vector<int64_t> pulses = meshes.frames(request.frames);
  const take::TakeInfo info = take::load_take_info({request.take});
  report_missing_pulses(info, request.frames, pulses);
  catch_interrupts();
  const int status = is_training(request.format) ? export_training(request, meshes, pulses)
                                                 : export_sequence(request, info, meshes, pulses);
  return std::max(status, report_unfinished_meshes(meshes));
}

namespace {

constexpr int kMaxChannels = 8;  // of FLAC

/// The sound files of the ledger. Empty for a take without a ledger.
std::vector<take::SoundLedger> sounds_of(const take::TakePaths& paths) {
  const auto type = io::value_or_throw(io::entry_type_of(paths.ledger()));
  if (type == fs::file_type::not_found) return {};
  return take::load_ledger(paths.ledger()).sounds;
}

/// Options of ffmpeg for the timecode of the first sample; none where the file has no timecode.
std::vector<std::string> timecode_tags(const fs::path& wave) {
  const auto reader = io::value_or_throw(sound::WaveReader::open(wave));
  const sound::WaveOrigin& origin = reader.origin();
  if (!origin.timecode_rate) return {};
  const sound::WaveTimecode first{.rate = *origin.timecode_rate,
                                  .samples_since_midnight = origin.samples_since_midnight};
  return {"-metadata", "timecode=" + first.text(reader.format().rate_hz), "-metadata",
          "timecode_rate=" + std::string(name(first.rate))};
}

void encode(const fs::path& wave, const fs::path& flac) {
  std::vector<std::string> command = {
      "ffmpeg", "-hide_banner",          "-loglevel",     "error", "-nostdin",
      "-i",     "file:" + wave.string(), "-map_metadata", "0"};
  for (std::string& tag : timecode_tags(wave)) command.push_back(std::move(tag));
  command.insert(command.end(), {"-c:a", "flac", "file:" + flac.string()});
  const ProcessResult done = run_process(command, Output::kShow);
  stop_if_interrupted();  // a terminal interrupts ffmpeg, too
  if (done.status != 0) throw std::runtime_error(flac.string() + ": ffmpeg could not write it");
}

}  // namespace

int export_flac(const fs::path& take, const fs::path& out) {
  const take::TakePaths paths{take};
  load_take_info(paths);  // throws if the folder is not a take
  const std::vector<take::SoundLedger> sounds = sounds_of(paths);
  if (sounds.empty()) {
    throw InputError(take.string() + ": has no sound; expected a take of a studio with [[sound]]");
  }
  for (const take::SoundLedger& sound : sounds) {
    if (sound.channels <= kMaxChannels) continue;
    throw InputError(sound.file + ": has " + std::to_string(sound.channels) +
                     " channels; FLAC has at most " + std::to_string(kMaxChannels));
  }
  if (const io::Status made = io::create_folders(fs::absolute(out).parent_path()); !made) {
    io::throw_input_error(made.error());
  }
  catch_interrupts();
  PartialFolder folder(out);
  for (const take::SoundLedger& sound : sounds) {
    stop_if_interrupted();
    // A ledger from elsewhere may name any path.
    const fs::path name = fs::path(sound.file).filename();
    encode(paths.sound() / name, folder.path() / fs::path(name).replace_extension(".flac"));
  }
  folder.finish();
  return kExitDone;
}

}  // namespace v3d::ctl
