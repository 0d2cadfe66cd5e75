#include "v3dctl/export/volume_export.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <meshoptimizer.h>

#include <functional>
#include <nlohmann/json.hpp>

#include "base/config/calib_file.h"
#include "base/core/error.h"
#include "base/image/image_files.h"
#include "base/io/file.h"
#include "codec/motion_codec.h"
#include "recon/shapes.h"
#include "support/message_of.h"
#include "support/sounding_take.h"
#include "support/temporary_folder.h"
#include "tools/decoded_sound.h"
#include "tools/glb.h"
#include "tools/probed_timecode.h"
#include "tools/test_images.h"
#include "v3dctl/import/import.h"
#include "v3dctl/motion/tracked_surfaces.h"
#include "v3dctl/scene/scene_sound.h"
#include "v3dctl/scene/scene_video.h"

namespace v3d::ctl {
namespace {

using testing::HasSubstr;
using testing::Not;
namespace fs = std::filesystem;

/// A take of a ball with five pulses, tracked in two segments: pulses 0 to 2 and 2 to 4, of which
/// the second has other triangles.
class VolumeExportTake : public testing::Test {
 protected:
  static constexpr int kPulses = 5;
  static constexpr double kFirstSample = 4800, kPeriod = 1920;

  VolumeExportTake() {
    save_calib(folder_ / "calib.toml", rig_);
    for (const RigCamera& camera : rig_) {
      for (int pulse = 0; pulse < kPulses; ++pulse) {
        const std::string name = std::to_string(pulse) + ".png";
        write(folder_ / "images" / camera.name / name, test::ball_image(camera));
        write(folder_ / "masks" / camera.name / name, test::ball_mask(camera));
      }
    }
    ImportOptions import;
    import.take = take_;
    import.calib = folder_ / "calib.toml";
    import.images = folder_ / "images";
    import.masks = folder_ / "masks";
    import_take(import);
    test::write_text(take::TakePaths{take_}.motion(), motion());
  }

  /// Gives the take a sound: a burst at pulse 3. `map`: whether its pulses are known.
  void add_sound(bool map = true) {
    add_sound(map, [](take::SoundLedger&) {});
  }
  /// `change`: changes the ledger's entry.
  void add_sound(bool map, const std::function<void(take::SoundLedger&)>& change) {
    const sound::PulseMap pulses{{{0, kFirstSample}, {kPulses, kFirstSample + kPulses * kPeriod}}};
    const take::TakePaths paths{take_};
    take::Ledger ledger{.take = "take", .commanded = kPulses, .sensed = {}, .cameras = {}};
    ledger.sounds.push_back(test::write_sound(
        paths, map ? pulses : sound::PulseMap(), 48'000, 1, [](int64_t sample, int) {
          return test::burst(static_cast<double>(sample), kFirstSample + 3 * kPeriod);
        }));
    change(ledger.sounds.back());
    io::throw_if_failed(save_ledger(paths.ledger(), ledger));
  }

  int exported(take::FrameRange frames = {}, bool uncompressed = false) {
    return export_volume({take_, folder_ / "out", frames, 128, uncompressed});
  }
  std::string rejection(take::FrameRange frames = {}) {
    return test::message_of<InputError>([&] { exported(frames); });
  }
  nlohmann::json manifest() {
    return nlohmann::json::parse(read_file(folder_ / "out/manifest.json"));
  }

  const test::TemporaryFolder folder_;
  const fs::path take_ = folder_ / "take";
  const Rig rig_ = test::small_rig(6);

 private:
  static void write(const fs::path& file, const Image& image) {
    fs::create_directories(file.parent_path());
    write_png(file, image.view());
  }

  /// The vertices of the ball, dark green, move to the right by a millimetre at each pulse.
  static std::string motion() {
    const std::vector<uint8_t> header = codec::MotionWriter::header();
    std::string bytes(header.begin(), header.end());
    codec::MotionWriter writer{codec::MotionEncoderOptions{}};
    for (int first : {0, 2}) {
      const Mesh ball = recon::shapes::sphere({0, 0, 0}, 0.3F, first == 0 ? 12 : 10);
      codec::MotionSegment segment;
      segment.key = 1;
      segment.triangles.assign(ball.triangles.begin(), ball.triangles.end());
      segment.colours.emplace_back(ball.vertices.size(), codec::VertexColour{0, 90, 0});
      for (int pulse = first; pulse <= first + 2; ++pulse) {
        segment.pulses.push_back(pulse);
        auto& positions = segment.positions.emplace_back();
        for (const Eigen::Vector3f& p : ball.vertices) {
          positions.push_back({p.x() + 0.001F * static_cast<float>(pulse), p.y(), p.z()});
        }
      }
      const auto encoded = writer.add(segment);
      bytes.append(encoded->bytes.begin(), encoded->bytes.end());
    }
    return bytes;
  }
};

TEST_F(VolumeExportTake, has_a_manifest_that_names_segments_and_videos) {
  EXPECT_EQ(exported(), kExitDone);
  const nlohmann::json file = manifest();
  EXPECT_EQ(file["format"], "v3d-volume");
  EXPECT_EQ(file["first_pulse"], 0);
  EXPECT_EQ(file["pulses"], kPulses);
  EXPECT_EQ(file["texture"]["side"], 128);
  EXPECT_FALSE(file.contains("sound")) << "the take has none";
  EXPECT_FALSE(file.contains("first_timecode"));
  ASSERT_EQ(file["segments"].size(), 2U);
  EXPECT_EQ(file["segments"][0]["last_pulse"], 1) << "the later segment shows pulse 2";
  EXPECT_EQ(file["segments"][1]["first_pulse"], 2);
  const TrackedSurfaces motion(folder_ / "out/motion.v3d");
  for (size_t s = 0; s < 2; ++s) {
    EXPECT_EQ(file["segments"][s]["vertices"], motion.segments()[s].vertices);
    EXPECT_EQ(file["segments"][s]["triangles"], motion.segments()[s].triangles);
  }
  for (const auto& segment : file["segments"]) {
    EXPECT_TRUE(fs::exists(folder_ / "out" / segment["surface"].get<std::string>()));
  }
  for (const auto& video : file["texture"]["videos"]) {
    EXPECT_TRUE(fs::exists(folder_ / "out" / video["file"].get<std::string>()));
  }
}

TEST_F(VolumeExportTake, states_the_level_of_its_video_in_the_manifest) {
  exported();
  const ProcessStream ffprobe(
      {"ffprobe", "-v", "error", "-select_streams", "v:0", "-show_entries", "stream=level", "-of",
       "default=nokey=1:noprint_wrappers=1", (folder_ / "out/texture-h264.mp4").string()},
      ProcessStream::End::kStdout);
  std::string level;
  for (uint8_t byte = 0; ffprobe.read({&byte, 1});) level += static_cast<char>(byte);
  EXPECT_EQ(level, "40\n");
  const nlohmann::json file = manifest();
  EXPECT_EQ(file["texture"]["videos"][0]["type"], "video/mp4; codecs=\"av01.0.08M.08\"");
  EXPECT_EQ(file["texture"]["videos"][1]["type"], "video/mp4; codecs=\"avc1.640028\"") << "4.0";
}

TEST_F(VolumeExportTake, is_rejected_for_a_texture_that_exceeds_all_levels_of_videos) {
  EXPECT_EQ(test::message_of<InputError>([&] {
              export_volume({take_, folder_ / "out", {}, 8192, false});
            }),
            "--atlas 8192: expected at most 5968 for a video at 25 Hz");
  EXPECT_FALSE(fs::exists(folder_ / "out"));
}

TEST_F(VolumeExportTake, keeps_positions_and_leaves_colours_to_the_texture) {
  exported();
  TrackedSurfaces before(take::TakePaths{take_}.motion());
  TrackedSurfaces after(folder_ / "out/motion.v3d");
  ASSERT_EQ(after.segments().size(), 2U);
  EXPECT_FALSE(after.segments()[0].coloured);
  EXPECT_EQ(after.segments()[0].pulses, (std::vector<int64_t>{0, 1}));
  EXPECT_EQ(after.segments()[1].pulses, (std::vector<int64_t>{2, 3, 4}));
  for (const auto& place : after.places()) {
    for (const Eigen::Vector3f& p : after.read(place).vertices) {
      const Eigen::Vector3f centre(0.001F * static_cast<float>(place.pulse), 0, 0);
      ASSERT_NEAR((p - centre).norm(), 0.3, 0.001);
    }
  }
}

/// The decoded attribute of a file that write_glb() has compressed with meshopt.
template <class T>
std::vector<T> decoded(const test::Glb& glb, const char* semantic, size_t stride) {
  const nlohmann::json& accessor = glb.accessor(semantic);
  const nlohmann::json& view = glb.scene["bufferViews"][accessor["bufferView"].get<size_t>()]
                                        ["extensions"]["EXT_meshopt_compression"];
  const auto count = view["count"].get<size_t>();
  std::vector<uint8_t> bytes(count * stride);
  EXPECT_EQ(view["byteStride"], stride);
  EXPECT_EQ(meshopt_decodeVertexBuffer(bytes.data(), count, stride,
                                       reinterpret_cast<const uint8_t*>(glb.buffer.data()) +
                                           view["byteOffset"].get<size_t>(),
                                       view["byteLength"].get<size_t>()),
            0);
  std::vector<T> values(bytes.size() / sizeof(T));
  std::memcpy(values.data(), bytes.data(), bytes.size());
  return values;
}

TEST_F(VolumeExportTake, numbers_the_vertices_of_a_surface_as_its_motion_does) {
  exported();
  TrackedSurfaces motion(folder_ / "out/motion.v3d");
  const Mesh surface = motion.read({1, 1, 3});  // the key pulse
  const test::Glb glb = test::parse_glb(read_file(folder_ / "out/segment-001.glb"));
  const auto numbers = decoded<float>(glb, "_VERTEX", 4);
  const auto positions = decoded<uint16_t>(glb, "POSITION", 8);
  const auto coordinates = decoded<uint16_t>(glb, "TEXCOORD_0", 4);
  const nlohmann::json& node = glb.scene["nodes"][0];
  ASSERT_EQ(numbers.size(), positions.size() / 4);
  ASSERT_EQ(numbers.size(), coordinates.size() / 2);
  EXPECT_GT(numbers.size(), surface.vertices.size()) << "seams divide vertices";
  const auto scale = node["scale"][0].get<double>();
  const auto& at = node["translation"];
  // The node turns (x, y, z) to (x, z, -y).
  const Eigen::Vector3d origin(at[0], -at[2].get<double>(), at[1]);
  for (size_t v = 0; v < numbers.size(); ++v) {
    const Eigen::Vector3d p =
        origin +
        scale * Eigen::Vector3d(positions[4 * v], positions[4 * v + 1], positions[4 * v + 2]);
    const auto number = static_cast<size_t>(numbers[v]);
    ASSERT_LT(number, surface.vertices.size());
    ASSERT_LT((p - surface.vertices[number].cast<double>()).norm(), 1e-4);
  }
}

TEST_F(VolumeExportTake, has_a_still_of_at_most_512_texels_in_each_surface) {
  export_volume({take_, folder_ / "out", {0, 1}, 1024, false});
  const test::Glb glb = test::parse_glb(read_file(folder_ / "out/segment-000.glb"));
  const nlohmann::json& view =
      glb.scene["bufferViews"][glb.scene["images"][0]["bufferView"].get<size_t>()];
  const auto* bytes = reinterpret_cast<const uint8_t*>(glb.buffer.data());
  const auto size = jpeg_size(
      std::span(bytes + view["byteOffset"].get<size_t>(), view["byteLength"].get<size_t>()));
  EXPECT_EQ(size, (ImageSize{512, 512}));
}

TEST_F(VolumeExportTake, has_one_picture_for_each_pulse_in_every_video) {
  exported({}, true);
  const nlohmann::json file = manifest();
  for (const auto& video : file["texture"]["videos"]) {
    VideoReader reader(folder_ / "out" / video["file"].get<std::string>(), {128, 128}, 25);
    for (int pulse = 0; pulse < kPulses; ++pulse) {
      const Image expected =
          read_picture(folder_ / "out/textures" / ("00000" + std::to_string(pulse) + ".png"));
      const Image& picture = reader.picture(pulse);
      double error = 0;
      for (size_t i = 0; i < picture.bytes.size(); ++i) {
        error += std::abs(picture.bytes[i] - expected.bytes[i]);
      }
      EXPECT_LT(error / static_cast<double>(picture.bytes.size()), 8)
          << video["file"] << " pulse " << pulse;
    }
  }
}

TEST_F(VolumeExportTake, shows_the_colours_of_the_cameras) {
  exported({0, 1}, true);
  const Image texture = read_picture(folder_ / "out/textures/000000.png");
  // The photographs are bright and grey, the vertices dark green.
  int64_t bright = 0, green = 0;
  for (size_t i = 0; i < texture.bytes.size(); i += 3) {
    bright += texture.bytes[i] > 100;
    green += texture.bytes[i] < 40 && texture.bytes[i + 1] > 60;
  }
  EXPECT_GT(bright, 8000);
  EXPECT_LT(green, bright / 4);
}

TEST_F(VolumeExportTake, shows_the_colours_of_vertices_for_a_take_without_raw_frames) {
  for (const RigCamera& camera : rig_) fs::remove(take::TakePaths{take_}.frames(camera.name));
  EXPECT_EQ(exported({0, 1}, true), kExitDone);
  const Image texture = read_picture(folder_ / "out/textures/000000.png");
  for (size_t i = 0; i < texture.bytes.size(); i += 3) {
    ASSERT_LT(texture.bytes[i], 12);
    ASSERT_NEAR(texture.bytes[i + 1], 90, 12);
  }
}

TEST_F(VolumeExportTake, is_complete_without_a_camera_of_the_studio_that_was_not_recorded) {
  Rig studio = rig_;
  studio.push_back({"absent", test::small_rig(7).back().model});
  fs::remove(take::TakePaths{take_}.calib());
  save_calib(take::TakePaths{take_}.calib(), studio);
  EXPECT_EQ(exported({0, 1}), kExitDone);
}

TEST_F(VolumeExportTake, has_the_sound_of_its_pulses_in_every_video) {
  add_sound();
  EXPECT_EQ(exported({1, 5}), kExitDone);
  const nlohmann::json file = manifest();
  EXPECT_EQ(file["sound"]["codec"], "mp4a.40.2");
  for (const auto& video : file["texture"]["videos"]) {
    EXPECT_THAT(video["type"].get<std::string>(), HasSubstr(", mp4a.40.2\""));
    const auto path = folder_ / "out" / video["file"].get<std::string>();
    const double heard = test::centre_of_sound(test::decoded_sound(path, 4 * kPeriod));
    EXPECT_THAT(test::probed_timecode(path), Not(HasSubstr("timecode")));
    EXPECT_NEAR(heard, 2 * kPeriod + 96, 0.005 * kSceneSoundRate) << "pulse 3 is picture 2";
  }
  for (const auto& entry : fs::directory_iterator(folder_ / "out")) {
    EXPECT_NE(entry.path().extension(), ".wav") << "the sound beside the videos is removed";
  }
}

TEST_F(VolumeExportTake, has_the_timecode_of_its_first_pulse_in_every_video_and_of_the_surfaces) {
  add_sound(true, [](take::SoundLedger& sound) {
    sound.timecode_source = "ltc";
    sound.timecode_rate = "25";
    sound.timecode_runs = {{kFirstSample, 100, kFirstSample + 9 * kPeriod, 109}};
  });
  EXPECT_EQ(exported({1, 5}), kExitDone);
  EXPECT_EQ(manifest()["first_timecode"], "00:00:04:01");
  EXPECT_EQ(manifest()["timecode_rate"], "25");
  const nlohmann::json described = manifest();
  for (const auto& video : described["texture"]["videos"]) {
    const std::string tags =
        test::probed_timecode(folder_ / "out" / video["file"].get<std::string>());
    EXPECT_THAT(tags, HasSubstr("TAG:timecode=00:00:04:01"));
    EXPECT_THAT(tags, HasSubstr("codec_tag_string=tmcd")) << "a track";
  }
  const test::Glb segment = test::parse_glb(read_file(folder_ / "out/segment-001.glb"));
  EXPECT_EQ(segment.scene["nodes"][0]["extras"]["pulse"], 3);
  EXPECT_EQ(segment.scene["nodes"][0]["extras"]["timecode"], "00:00:04:03");
}

TEST_F(VolumeExportTake, names_no_sound_where_none_is_in_step_with_the_pulses) {
  add_sound(false);
  testing::internal::CaptureStderr();
  EXPECT_EQ(exported(), kExitDone);
  EXPECT_THAT(testing::internal::GetCapturedStderr(),
              HasSubstr("sound/cap01.wav: has no map of pulses; the delivery is without this"));
  EXPECT_FALSE(manifest().contains("sound"));
}

TEST_F(VolumeExportTake, is_written_with_a_line_that_names_the_pulses_without_a_surface) {
  take::TakeInfo info = take::load_take_info({take_});
  info.pulses = kPulses + 2;
  io::throw_if_failed(take::save_take_info({take_}, info));
  testing::internal::CaptureStderr();
  exported({1, kPulses + 1});
  EXPECT_THAT(testing::internal::GetCapturedStderr(),
              HasSubstr("v3dctl: left out, because they have no surface: 1 pulse (5)\n"));
}

TEST_F(VolumeExportTake, contains_the_pulses_of_the_range) {
  exported({1, 4});
  EXPECT_EQ(manifest()["first_pulse"], 1);
  EXPECT_EQ(manifest()["pulses"], 3);
  EXPECT_EQ(TrackedSurfaces(folder_ / "out/motion.v3d").places().size(), 3U);
}

TEST_F(VolumeExportTake, is_refused_with_what_would_be_right) {
  EXPECT_THAT(rejection({7, 9}), HasSubstr("has no surface of the pulses of --frames"));
  EXPECT_FALSE(fs::exists(folder_ / "out"));
  fs::create_directory(folder_ / "out");
  test::write_text(folder_ / "out/mine.txt", "mine");
  EXPECT_THAT(rejection(), HasSubstr("out: is not empty"));
  EXPECT_EQ(read_file(folder_ / "out/mine.txt"), "mine");
  fs::remove(take::TakePaths{take_}.motion());
  EXPECT_THAT(rejection(), HasSubstr("run v3dctl track"));
}

}  // namespace
}  // namespace v3d::ctl
