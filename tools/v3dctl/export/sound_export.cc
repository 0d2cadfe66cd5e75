#include "v3dctl/export/sound_export.h"

#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "base/core/error.h"
#include "base/io/child_process.h"
#include "common/console.h"
#include "common/partial_folder.h"
#include "sound/wave_file.h"
#include "take/ledger/ledger.h"
#include "v3dctl/options.h"

namespace v3d::ctl {
namespace {

namespace fs = std::filesystem;

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
