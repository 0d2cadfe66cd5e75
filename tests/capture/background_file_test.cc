#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <fstream>
#include <iterator>

#include "base/core/error.h"
#include "capture/segmentation/segmenter.h"
#include "studio_wall.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"

namespace v3d::capture {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::HasSubstr;

class BackgroundFile : public testing::Test {
 protected:
  std::string bytes(const std::string& file) const {
    std::ifstream in(folder_ / file, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
  }
  void write(const std::string& file, const std::string& text) const {
    std::ofstream(folder_ / file, std::ios::binary) << text;
  }
  std::string load_error() const {
    return test::message_of<InputError>(
        [&] { segmentation::load_background(folder_.path(), "cam07"); });
  }

  const test::TemporaryFolder folder_;
};

TEST_F(BackgroundFile, loads_the_model_that_was_saved) {
  for (const PixelFormat format :
       {PixelFormat::kMono8, PixelFormat::kBayerGB8, PixelFormat::kRGB8}) {
    const segmentation::BackgroundModel model = learn_wall({53, 31}, format);
    save_background(folder_.path(), "cam07", model);
    const segmentation::BackgroundModel loaded =
        segmentation::load_background(folder_.path(), "cam07");
    EXPECT_EQ(loaded.size, model.size);
    EXPECT_EQ(loaded.format, format);
    EXPECT_EQ(loaded.mean, model.mean);
    EXPECT_EQ(loaded.spread, model.spread);
  }
}

TEST_F(BackgroundFile, keeps_the_chroma_key) {
  segmentation::BackgroundModel model = learn_wall({16, 16}, PixelFormat::kBayerGB8);
  model.key = ChromaKey::kGreen;
  save_background(folder_.path(), "cam07", model);
  EXPECT_EQ(segmentation::load_background(folder_.path(), "cam07").key, ChromaKey::kGreen);
  write("cam07.toml", "pixel_format = \"BayerGB8\"\nchroma_key = \"pink\"\n");
  EXPECT_THAT(load_error(), HasSubstr("chroma_key: is not known"));
}

TEST_F(BackgroundFile, saves_the_same_bytes_after_loading) {
  save_background(folder_.path(), "cam07", learn_wall({53, 31}, PixelFormat::kRGB8));
  save_background(folder_.path(), "cam08", segmentation::load_background(folder_.path(), "cam07"));
  EXPECT_EQ(bytes("cam07.mean.png"), bytes("cam08.mean.png"));
  EXPECT_EQ(bytes("cam07.spread.png"), bytes("cam08.spread.png"));
  EXPECT_EQ(bytes("cam07.toml"), bytes("cam08.toml"));
  EXPECT_FALSE(bytes("cam07.toml").empty());
}

TEST_F(BackgroundFile, exists_only_if_all_its_files_exist) {
  EXPECT_FALSE(segmentation::has_background(folder_.path(), "cam07"));
  save_background(folder_.path(), "cam07", learn_wall({16, 16}, PixelFormat::kMono8));
  EXPECT_TRUE(segmentation::has_background(folder_.path(), "cam07"));
  EXPECT_FALSE(segmentation::has_background(folder_.path(), "cam08"));
  fs::remove(folder_ / "cam07.spread.png");
  EXPECT_FALSE(segmentation::has_background(folder_.path(), "cam07"));
}

TEST_F(BackgroundFile, rejects_links_and_fifos) {
  save_background(folder_.path(), "cam07", learn_wall({16, 16}, PixelFormat::kMono8));
  for (const char* name : {"cam07.toml", "cam07.mean.png", "cam07.spread.png"}) {
    fs::rename(folder_ / name, folder_ / "kept");
    fs::create_symlink("kept", folder_ / name);
    EXPECT_THAT(load_error(), AllOf(HasSubstr(name), HasSubstr("it is a symbolic link")));
    fs::remove(folder_ / name);
    ASSERT_EQ(mkfifo((folder_ / name).c_str(), 0644), 0);
    EXPECT_THAT(load_error(), AllOf(HasSubstr(name), HasSubstr("it is not a regular file")));
    fs::remove(folder_ / name);
    fs::rename(folder_ / "kept", folder_ / name);
  }
  EXPECT_NO_THROW(segmentation::load_background(folder_.path(), "cam07"));
}

TEST_F(BackgroundFile, limits_images_to_256_MiB_and_texts_to_8_MiB) {
  save_background(folder_.path(), "cam07", learn_wall({16, 16}, PixelFormat::kMono8));
  fs::resize_file(folder_ / "cam07.mean.png", (256 << 20) + 1);
  EXPECT_THAT(load_error(), AllOf(HasSubstr("cam07.mean.png"), HasSubstr("longer than")));
  fs::resize_file(folder_ / "cam07.toml", (8 << 20) + 1);
  EXPECT_THAT(load_error(), AllOf(HasSubstr("cam07.toml"), HasSubstr("longer than")));
}

TEST_F(BackgroundFile, names_a_missing_or_invalid_file) {
  EXPECT_THAT(load_error(), HasSubstr("cam07.toml"));
  save_background(folder_.path(), "cam07", learn_wall({32, 24}, PixelFormat::kMono8));
  const std::string mean = bytes("cam07.mean.png");

  write("cam07.toml", "pixel_format = \"Beyer\"\n");
  EXPECT_THAT(load_error(), AllOf(HasSubstr("cam07.toml:1"), HasSubstr("pixel_format")));
  write("cam07.toml", "pixel_format = \"RGB8\"\n");
  EXPECT_THAT(load_error(), AllOf(HasSubstr("cam07.mean.png"), HasSubstr("3 channel")));
  write("cam07.toml", "pixel_format = \"Mono8\"\n");

  write("cam07.mean.png", mean.substr(0, mean.size() / 3));
  EXPECT_THAT(load_error(), HasSubstr("cam07"));
  write("cam07.mean.png", "no picture");
  EXPECT_THAT(load_error(), AllOf(HasSubstr("cam07.mean.png"), HasSubstr("not a valid PNG")));
  write("cam07.mean.png", "");
  EXPECT_THAT(load_error(), AllOf(HasSubstr("cam07.mean.png"), HasSubstr("not a valid PNG")));
  fs::remove(folder_ / "cam07.mean.png");
  EXPECT_THAT(load_error(), HasSubstr("cam07.mean.png"));

  save_background(folder_.path(), "cam08", learn_wall({24, 32}, PixelFormat::kMono8));
  write("cam07.mean.png", mean);
  fs::copy_file(folder_ / "cam08.spread.png", folder_ / "cam07.spread.png",
                fs::copy_options::overwrite_existing);
  EXPECT_THAT(load_error(), AllOf(HasSubstr("cam07.spread.png"), HasSubstr("32x24")));
}

}  // namespace
}  // namespace v3d::capture
