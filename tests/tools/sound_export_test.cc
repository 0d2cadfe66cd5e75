#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <cstring>

#include "base/core/error.h"
#include "base/io/child_process.h"
#include "support/message_of.h"
#include "support/sounding_take.h"
#include "support/temporary_folder.h"
#include "v3dctl/export/take_export.h"
#include "v3dctl/options.h"

namespace v3d::ctl {
namespace {

using testing::HasSubstr;
using testing::Not;

class FlacExport : public testing::Test {
 protected:
  static constexpr int64_t kSamples = 48'000;

  void SetUp() override {
    if (std::system("command -v ffmpeg >/dev/null") != 0) GTEST_SKIP() << "there is no ffmpeg";
  }
  /// A take of two channels with noise in all 24 bits.
  void write_take(const std::optional<sound::WaveTimecode>& timecode = {}) {
    const take::SoundLedger sound{.file = "sound/cap01.wav",
                                  .node = "cap01",
                                  .rate_hz = 48'000,
                                  .channels = 2,
                                  .samples = kSamples};
    test::write_sounds_of_ledger(take_, {sound});
    io::throw_if_failed(save_take_info(take_, test::begun_take({})));
    std::filesystem::create_directories(take_.sound());
    auto writer = io::value_or_throw(
        sound::WaveWriter::create(take_.sound() / "cap01.wav", {.rate_hz = 48'000, .channels = 2},
                                  {.description = "take kendo-07, node cap01",
                                   .originator = "V3D",
                                   .date = "2026-11-27",
                                   .time = "15:04:05",
                                   .samples_since_midnight = 2'604'245'678}));
    uint32_t state = 1;
    for (int64_t i = 0; i < 2 * kSamples; ++i) {
      state = state * 1'664'525 + 1'013'904'223;
      values_.push_back(static_cast<int32_t>(state & 0xFFFFFF00));
    }
    io::throw_if_failed(writer.write(values_));
    io::throw_if_failed(writer.finish(timecode));
  }
  /// The samples of a file, as ffmpeg decodes them to 32 bits.
  static std::vector<int32_t> decoded(const std::filesystem::path& path) {
    const ProcessStream ffmpeg(
        {"ffmpeg", "-loglevel", "error", "-i", path.string(), "-f", "s32le", "pipe:1"},
        ProcessStream::End::kStdout);
    std::vector<int32_t> values(2 * kSamples + 1);
    const std::span bytes(reinterpret_cast<uint8_t*>(values.data()), 4 * (values.size() - 1));
    EXPECT_TRUE(ffmpeg.read(bytes));
    EXPECT_FALSE(ffmpeg.read({reinterpret_cast<uint8_t*>(&values.back()), 1})) << "it ends there";
    values.pop_back();
    return values;
  }

  std::string tags() const {
    return run_process({"ffprobe", "-v", "error", "-show_entries", "format_tags",
                        (folder_ / "out/cap01.flac").string()},
                       Output::kCapture)
        .output;
  }

  const test::TemporaryFolder folder_;
  const take::TakePaths take_{folder_ / "kendo-07"};
  std::vector<int32_t> values_;
};

TEST_F(FlacExport, has_every_bit_of_every_sample) {
  write_take();
  EXPECT_EQ(export_flac(take_.folder, folder_ / "out"), kExitDone);
  EXPECT_EQ(decoded(folder_ / "out/cap01.flac"), values_);
  EXPECT_LT(static_cast<int64_t>(std::filesystem::file_size(folder_ / "out/cap01.flac")),
            4 * 2 * kSamples)
      << "24 bits, not 32";
}

TEST_F(FlacExport, keeps_the_time_reference_as_a_tag) {
  write_take();
  export_flac(take_.folder, folder_ / "out");
  EXPECT_THAT(tags(), HasSubstr("TAG:time_reference=2604245678"));
  EXPECT_THAT(tags(), HasSubstr("2026-11-27"));
  EXPECT_THAT(tags(), Not(HasSubstr("timecode")));
}

TEST_F(FlacExport, has_the_timecode_of_the_first_sample_as_tags) {
  write_take(sound::WaveTimecode{.rate = sound::TimecodeRate::k2997Drop,
                                 .samples_since_midnight = 1'727'998'272});
  export_flac(take_.folder, folder_ / "out");
  EXPECT_THAT(tags(), HasSubstr("TAG:timecode=10:00:00;00"));
  EXPECT_THAT(tags(), HasSubstr("TAG:timecode_rate=29.97df"));
  EXPECT_THAT(tags(), HasSubstr("TAG:time_reference=1727998272"));
}

using FlacExportDeathTest = FlacExport;

TEST_F(FlacExportDeathTest, leaves_no_folder_after_an_interrupt) {
  write_take();
  const auto ffmpeg = folder_ / "ffmpeg";
  test::write_text(ffmpeg, "#!/bin/sh\nkill -INT $PPID\nexit 255\n");
  std::filesystem::permissions(ffmpeg, std::filesystem::perms::owner_all);
  const auto export_interrupted = [&] {
    setenv("PATH", (folder_.path().string() + ":" + std::getenv("PATH")).c_str(), 1);
    const auto act = [&] { export_flac(take_.folder, folder_ / "out"); };
    std::_Exit(test::message_of<std::runtime_error>(act) == "interrupted" ? 7 : 0);
  };
  EXPECT_EXIT(export_interrupted(), testing::ExitedWithCode(7), "");
  std::vector<std::string> names;
  for (const auto& entry : std::filesystem::directory_iterator(folder_.path())) {
    names.push_back(entry.path().filename());
  }
  EXPECT_THAT(names, testing::UnorderedElementsAre("ffmpeg", "kendo-07"));
}

TEST_F(FlacExport, is_refused_for_a_take_without_sound_and_for_nine_channels) {
  test::write_sounds_of_ledger(take_, {});
  io::throw_if_failed(save_take_info(take_, test::begun_take({})));
  const auto rejection = [&] {
    return test::message_of<InputError>([&] { export_flac(take_.folder, folder_ / "out"); });
  };
  EXPECT_THAT(rejection(), HasSubstr("has no sound"));
  test::write_sounds_of_ledger(take_, {{.file = "sound/a.wav", .node = "a", .channels = 9}});
  EXPECT_THAT(rejection(), HasSubstr("sound/a.wav: has 9 channels; FLAC has at most 8"));
}

}  // namespace
}  // namespace v3d::ctl
