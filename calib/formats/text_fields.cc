#include "calib/formats/text_fields.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>

#include "base/core/error.h"
#include "base/core/printable.h"

namespace v3d::calib {
namespace {

constexpr std::string_view kBlanks = " \t\r";

}  // namespace

TextLine::TextLine(std::string_view text, std::string path, int number)
    : left_(text), path_(std::move(path)), number_(number) {
  skip_blanks();
}

void TextLine::skip_blanks() {
  left_.remove_prefix(std::min(left_.find_first_not_of(kBlanks), left_.size()));
}

int TextLine::count_words() const {
  TextLine copy = *this;
  int count = 0;
  for (; !copy.done(); ++count) copy.word("");
  return count;
}

std::string_view TextLine::word(std::string_view what) {
  if (done()) fail(std::string(what) + ": missing");
  const std::string_view found = left_.substr(0, left_.find_first_of(kBlanks));
  left_.remove_prefix(found.size());
  skip_blanks();
  return found;
}

double TextLine::real(std::string_view what) {
  const std::string_view found = word(what);
  const std::string_view digits = found.substr(found.starts_with('+') ? 1 : 0);
  double value = 0;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
  const bool whole = error == std::errc() && end == digits.data() + digits.size();
  if (!whole || !std::isfinite(value)) {
    fail(std::string(what) + ": expected a finite number, found '" + printable(found) + "'");
  }
  return value;
}

int64_t TextLine::whole(std::string_view what) {
  const std::string_view found = word(what);
  int64_t value = 0;
  const auto [end, error] = std::from_chars(found.data(), found.data() + found.size(), value);
  if (error != std::errc() || end != found.data() + found.size()) {
    fail(std::string(what) + ": expected a whole number, found '" + printable(found) + "'");
  }
  return value;
}

Eigen::Vector3d TextLine::vector(std::string_view what) {
  Eigen::Vector3d v;
  for (int i = 0; i < 3; ++i) v[i] = real(what);
  return v;
}

Eigen::Matrix3d TextLine::matrix(std::string_view what) {
  Eigen::Matrix3d m;
  for (int row = 0; row < 3; ++row) m.row(row) = vector(what).transpose();
  return m;
}

std::string_view TextLine::remaining(std::string_view what) {
  if (done()) fail(std::string(what) + ": missing");
  std::string_view found = left_;
  found.remove_suffix(found.size() - 1 - found.find_last_not_of(kBlanks));
  left_ = {};
  return found;
}

void TextLine::fail(const std::string& message) const {
  throw InputError(path_ + ":" + std::to_string(number_) + ": " + message);
}

std::vector<TextLine> split_lines(std::string_view text, const std::filesystem::path& path) {
  std::vector<TextLine> lines;
  while (!text.empty()) {
    const size_t end = std::min(text.find('\n'), text.size());
    lines.emplace_back(text.substr(0, end), path.string(), static_cast<int>(lines.size()) + 1);
    text.remove_prefix(std::min(end + 1, text.size()));
  }
  return lines;
}

std::string number_text(double value) {
  std::array<char, 40> text{};
  return {text.data(), std::to_chars(text.data(), text.data() + text.size(), value).ptr};
}

std::string numbers_text(const Eigen::Ref<const Eigen::VectorXd>& values) {
  std::string text;
  for (const double value : values) text += " " + number_text(value);
  return text;
}

}  // namespace v3d::calib
