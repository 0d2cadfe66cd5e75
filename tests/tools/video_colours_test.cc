// Colours of videos, by the matrix and range that a file states.
#include <gtest/gtest.h>

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
}

#include <array>
#include <cstdint>
#include <cstring>
#include <filesystem>

#include "base/image/image.h"
#include "support/temporary_folder.h"
#include "v3dctl/import/media.h"

namespace v3d::ctl {
namespace {

using Colour = std::array<uint8_t, 3>;

struct ColourSpace {
  AVColorSpace matrix;
  AVColorRange range;
};

/// Writes a lossless video of one frame, all of whose pixels have this Y, Cb and Cr.
void write_plain_video(const std::filesystem::path& path, const ColourSpace& space,
                       const Colour& yuv) {
  constexpr int kWidth = 64, kHeight = 48;
  AVFormatContext* file = nullptr;
  ASSERT_GE(avformat_alloc_output_context2(&file, nullptr, nullptr, path.c_str()), 0);
  const AVCodec* const encoder = avcodec_find_encoder(AV_CODEC_ID_FFV1);
  ASSERT_NE(encoder, nullptr);
  AVCodecContext* codec = avcodec_alloc_context3(encoder);
  codec->width = kWidth;
  codec->height = kHeight;
  codec->pix_fmt = AV_PIX_FMT_YUV444P;
  codec->time_base = {1, 25};
  codec->colorspace = space.matrix;
  codec->color_range = space.range;
  ASSERT_GE(avcodec_open2(codec, encoder, nullptr), 0);
  AVStream* const stream = avformat_new_stream(file, nullptr);
  ASSERT_GE(avcodec_parameters_from_context(stream->codecpar, codec), 0);
  ASSERT_GE(avio_open(&file->pb, path.c_str(), AVIO_FLAG_WRITE), 0);
  ASSERT_GE(avformat_write_header(file, nullptr), 0);

  AVFrame* frame = av_frame_alloc();
  frame->width = kWidth;
  frame->height = kHeight;
  frame->format = AV_PIX_FMT_YUV444P;
  frame->colorspace = space.matrix;
  frame->color_range = space.range;
  ASSERT_GE(av_frame_get_buffer(frame, 0), 0);
  for (size_t plane = 0; plane < yuv.size(); ++plane) {
    std::memset(frame->data[plane], yuv[plane],
                static_cast<size_t>(frame->linesize[plane]) * kHeight);
  }
  AVPacket* packet = av_packet_alloc();
  ASSERT_GE(avcodec_send_frame(codec, frame), 0);
  ASSERT_GE(avcodec_send_frame(codec, nullptr), 0);
  ASSERT_GE(avcodec_receive_packet(codec, packet), 0);
  ASSERT_GE(av_write_frame(file, packet), 0);
  ASSERT_GE(av_write_trailer(file), 0);

  av_packet_free(&packet);
  av_frame_free(&frame);
  avcodec_free_context(&codec);
  avio_closep(&file->pb);
  avformat_free_context(file);
}

Colour imported(const ColourSpace& space, const Colour& yuv) {
  const test::TemporaryFolder folder;
  write_plain_video(folder / "a.mkv", space, yuv);
  const auto image = VideoFile(folder / "a.mkv").next();
  if (!image) return {};
  return {image->row(20)[30], image->row(20)[31], image->row(20)[32]};
}

void expect_near(const Colour& found, const Colour& wanted) {
  for (size_t i = 0; i < found.size(); ++i) {
    EXPECT_NEAR(found[i], wanted[i], 2) << "channel " << i;
  }
}

/// RGB (200, 50, 50) in both matrices (ITU-R BT.709, BT.601), limited range.
TEST(VideoColours, are_those_of_the_matrix_that_the_file_states) {
  expect_near(imported({AVCOL_SPC_BT709, AVCOL_RANGE_MPEG}, {86, 113, 194}), {200, 50, 50});
  expect_near(imported({AVCOL_SPC_SMPTE170M, AVCOL_RANGE_MPEG}, {97, 106, 194}), {200, 50, 50});
}

TEST(VideoColours, have_the_matrix_of_bt_601_when_the_file_states_none) {
  expect_near(imported({AVCOL_SPC_UNSPECIFIED, AVCOL_RANGE_UNSPECIFIED}, {97, 106, 194}),
              {200, 50, 50});
}

TEST(VideoColours, have_the_range_that_the_file_states) {
  expect_near(imported({AVCOL_SPC_BT709, AVCOL_RANGE_JPEG}, {50, 128, 128}), {50, 50, 50});
  expect_near(imported({AVCOL_SPC_BT709, AVCOL_RANGE_MPEG}, {59, 128, 128}), {50, 50, 50});
}

}  // namespace
}  // namespace v3d::ctl
