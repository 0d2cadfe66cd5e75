#include <gtest/gtest.h>

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "codec/frame_reviser.h"
#include "tests/codec/coded_scene.h"

namespace v3d::codec {
namespace {

std::vector<uint8_t> labels_of(const Scene& scene) {
  std::vector<uint8_t> labels(scene.mesh.vertices.size());
  for (size_t v = 0; v < labels.size(); ++v) labels[v] = static_cast<uint8_t>(v / 100 % 3);
  return labels;
}

/// Frames with the colours of two cameras that see all that faces them.
std::vector<std::vector<uint8_t>> frames_with_views() {
  std::vector<std::vector<uint8_t>> all;
  FrameReviser reviser;
  for (const auto& frame : moving_ball(3)) {
    EXPECT_EQ(reviser.decode(frame), DecodeStatus::kOk);
    std::vector<CameraView> views(2);
    views[0].axis = {20000, -20000, 16000};
    views[1].axis = {-20000, 20000, -16000};
    for (uint32_t c = 0; c < 2; ++c) {
      for (uint32_t v = 0; v < reviser.frame().positions.size(); ++v) {
        const auto level = static_cast<uint8_t>(hash(v / 5, c));
        views[c].vertices.push_back({level, 128, 90, 255});
      }
    }
    all.push_back(reviser.with_cameras(views, 4000));
  }
  return all;
}

/// A sequence with a lost frame, a damaged frame, labelled vertices displaced in two passes, a
/// frame whose reference is missing, and colours of cameras.
std::vector<std::vector<uint8_t>> frames() {
  std::vector<std::vector<uint8_t>> all = moving_ball(9);
  all.erase(all.begin() + 5);
  all[2][300] ^= 1;
  Scene scene(ball(15));
  scene.paint(1);
  scene.move(0.02);
  FrameContent deformed = scene.content(0);
  deformed.metadata.live_passes = 2;
  const std::vector<uint8_t> labels = labels_of(scene);
  deformed.labels = labels;
  all.push_back(FrameEncoder({}).encode(deformed).value());
  for (auto& frame : frames_with_views()) all.push_back(std::move(frame));
  return all;
}

template <class Numbers>
void append(std::string& text, const Numbers& numbers) {
  text.append(reinterpret_cast<const char*>(numbers.data()), numbers.size() * sizeof(numbers[0]));
}

/// Decodes natively; the format is that of decode.mjs.
std::string decoded_here(const std::vector<std::vector<uint8_t>>& frames) {
  FrameDecoder decoder;
  decoder.enable_cameras(true);
  std::string text;
  for (const auto& frame : frames) {
    text.push_back(static_cast<char>(decoder.decode(frame)));
    text.push_back(static_cast<char>(decoder.frame().metadata.live_passes));
    append(text, decoder.frame().positions);
    append(text, decoder.frame().triangles);
    append(text, decoder.frame().colours);
    append(text, decoder.frame().labels);
    for (const CameraView& view : decoder.frame().cameras) append(text, view.vertices);
  }
  return text;
}

/// Writes each frame after its length (u32).
void write_frames(const std::filesystem::path& file,
                  const std::vector<std::vector<uint8_t>>& frames) {
  std::ofstream out(file, std::ios::binary);
  for (const auto& frame : frames) {
    const auto size = static_cast<uint32_t>(frame.size());
    out.write(reinterpret_cast<const char*>(&size), sizeof size);
    out.write(reinterpret_cast<const char*>(frame.data()), size);
  }
}

std::string decoded_in_node(const std::vector<std::vector<uint8_t>>& frames) {
  const auto file = std::filesystem::path(testing::TempDir()) / "v3d-wasm-frames";
  write_frames(file, frames);
  FILE* node = popen(("node " V3D_DECODE_MJS " " V3D_WASM " " + file.string()).c_str(), "r");
  std::string text(1 << 20, 0);
  size_t size = 0;
  while (const size_t more = fread(&text[size], 1, text.size() - size, node)) {
    size += more;
    text.resize(size + (1 << 20));
  }
  EXPECT_EQ(pclose(node), 0) << "decode.mjs failed; is node installed? Run tools/install-deps";
  std::filesystem::remove(file);
  text.resize(size);
  return text;
}

TEST(WasmDecoder, decodes_every_frame_to_the_same_bits_as_the_native_decoder) {
  const auto given = frames();
  EXPECT_TRUE(decoded_in_node(given) == decoded_here(given));
}

TEST(WasmDecoder, starts_anew_when_its_memory_was_exhausted) {
  const auto file = std::filesystem::path(testing::TempDir()) / "v3d-wasm-exhausted";
  write_frames(file, moving_ball(2));
  const std::string command = "node " V3D_EXHAUST_MEMORY_MJS " " V3D_WASM " " + file.string();
  EXPECT_EQ(std::system(command.c_str()), 0) << "exhaust_memory.mjs failed, or node is missing";
  std::filesystem::remove(file);
}

}  // namespace
}  // namespace v3d::codec
