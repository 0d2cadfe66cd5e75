// Lines of words and numbers, as COLMAP and Middlebury write them, with errors that name file and
// line.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace v3d::calib {

/// One line of a text, read from left to right; words stand between blanks. Borrows the text. What
/// is missing or is no number throws InputError ("images.txt:4: QW: expected a finite number, found
/// 'x'").
class TextLine {
 public:
  TextLine(std::string_view text, std::string path, int number);

  /// Nothing is left but blanks.
  bool done() const { return left_.empty(); }
  bool is_comment() const { return left_.starts_with('#'); }
  int number() const { return number_; }
  /// That are left.
  int count_words() const;

  std::string_view word(std::string_view what);
  double real(std::string_view what);
  int64_t whole(std::string_view what);
  Eigen::Vector3d vector(std::string_view what);
  /// Row by row.
  Eigen::Matrix3d matrix(std::string_view what);
  /// All that is left, blanks within included.
  std::string_view rest(std::string_view what);

  [[noreturn]] void fail(const std::string& message) const;

 private:
  void skip_blanks();

  std::string_view left_;
  std::string path_;
  int number_ = 0;
};

/// Every line, also empty ones.
std::vector<TextLine> lines_of(std::string_view text, const std::filesystem::path& path);

/// Reads back to the same bits: "0.1", "3", "1e-09".
std::string number_text(double value);
/// Each behind a blank.
std::string numbers_text(const Eigen::Ref<const Eigen::VectorXd>& values);

}  // namespace v3d::calib
