// Text fields and time stamps.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace v3d::calib {

// Parser and printer for lines of words and numbers, as COLMAP and Middlebury use them.

/// Reads the words of one line from left to right. Words are separated by blanks.
///
/// Borrows the text. `what` names the field in messages. A missing word and an invalid number throw
/// InputError: "images.txt:4: QW: expected a finite number, found 'x'".
class TextLine {
 public:
  TextLine(std::string_view text, std::string path, int number);

  /// Only blanks remain.
  bool done() const { return left_.empty(); }
  bool is_comment() const { return left_.starts_with('#'); }
  int number() const { return number_; }
  /// The number of remaining words.
  int count_words() const;

  std::string_view word(std::string_view what);
  double real(std::string_view what);
  int64_t whole(std::string_view what);
  Eigen::Vector3d vector(std::string_view what);
  /// Row by row.
  Eigen::Matrix3d matrix(std::string_view what);
  /// The remaining text, including inner blanks.
  std::string_view remaining(std::string_view what);

  [[noreturn]] void fail(const std::string& message) const;

 private:
  void skip_blanks();

  std::string_view left_;
  std::string path_;
  int number_ = 0;
};

/// All lines, including empty ones.
std::vector<TextLine> split_lines(std::string_view text, const std::filesystem::path& path);

/// The shortest text that reads back to the same bits: "0.1", "3", "1e-09".
std::string number_text(double value);
/// The numbers, each after a blank.
std::string numbers_text(const Eigen::Ref<const Eigen::VectorXd>& values);

// Time stamps that assign frames of several videos to instants: the CSV of caliscope and freemocap.

/// The instant (sync_index) by camera id and frame index.
using TimeStamps = std::map<std::string, std::map<int64_t, int64_t>>;

/// Reads a CSV with the columns sync_index, cam_id (or port) and frame_index. Further columns, and
/// rows without a frame, are ignored. Throws InputError with `path` and line.
TimeStamps parse_time_stamps(std::string_view csv, const std::filesystem::path& path);

struct FrameInstants {
  std::map<int64_t, int64_t> instants;  ///< by frame of the video, counted from 0
  int64_t beyond = 0;                   ///< number of time stamps beyond the end of the video
};

/// The instants of one camera.
///
/// Camera ids match by name, else by the number at the end of the name ("cam_2" and "cam02" match
/// 2). Where frame indices far exceed the number of `frames` in the video (0: unknown), or have its
/// length, they are counted from the camera's first index. Otherwise the video lacks frames at its
/// end, such as a damaged one, and the time stamps beyond it are left out. Throws InputError where
/// the table lacks the camera.
FrameInstants frame_instants(const TimeStamps& stamps, const std::string& camera, int64_t frames,
                             const std::filesystem::path& path);

}  // namespace v3d::calib
