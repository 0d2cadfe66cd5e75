#include "v3dctl/json_field.h"

#include <cmath>

#include "base/core/error.h"

namespace v3d::ctl {
namespace {

using nlohmann::json;

constexpr double kMaxMetres = 1e6;
constexpr int64_t kMaxPulses = int64_t{1} << 53;

std::string text_of(double number) { return json(number).dump(); }

}  // namespace

void JsonField::fail(const std::string& what) const {
  throw InputError(file_.string() + ": " + (where_.empty() ? "" : where_ + ": ") + what);
}

void JsonField::expect_object(const std::set<std::string>& known) const {
  if (!value_->is_object()) fail("expected an object");
  for (const auto& [key, value] : value_->items()) {
    if (!known.contains(key)) fail("there is no key '" + key + "'");
  }
}

std::optional<JsonField> JsonField::find(const std::string& key) const {
  const auto found = value_->find(key);
  if (found == value_->end()) return {};
  return JsonField(*found, file_, where_.empty() ? key : where_ + "." + key);
}

JsonField JsonField::at(const std::string& key) const {
  if (auto field = find(key)) return *field;
  fail("'" + key + "' is missing");
}

std::vector<JsonField> JsonField::list() const {
  if (!value_->is_array()) fail("expected a list");
  std::vector<JsonField> fields;
  for (size_t i = 0; i < value_->size(); ++i) {
    fields.emplace_back((*value_)[i], file_, where_ + "[" + std::to_string(i) + "]");
  }
  return fields;
}

double JsonField::number(double min, double max) const {
  const double n = value_->is_number() ? value_->get<double>() : NAN;
  if (n >= min && n <= max) return n;
  fail("expected a number from " + text_of(min) + " to " + text_of(max));
}

double JsonField::positive() const {
  const double n = value_->is_number() ? value_->get<double>() : NAN;
  if (n > 0 && n <= 1000) return n;
  fail("expected a number above 0, at most 1000");
}

int64_t JsonField::integer(int64_t min, int64_t max) const {
  const bool fits = value_->is_number_unsigned()
                        ? value_->get<uint64_t>() <= static_cast<uint64_t>(kMaxPulses)
                        : value_->is_number_integer();
  const int64_t n = fits ? value_->get<int64_t>() : min - 1;
  if (n >= min && n <= max) return n;
  fail("expected a whole number from " + std::to_string(min) + " to " + std::to_string(max));
}

int64_t JsonField::pulse() const {
  const int64_t n = value_->is_number_integer() ? value_->get<int64_t>() : -1;
  if (n >= 0 && n < kMaxPulses) return n;
  fail("expected the number of a pulse");
}

int JsonField::performer() const {
  const int64_t n = value_->is_number_integer() ? value_->get<int64_t>() : 0;
  if (n >= 1 && n <= 255) return static_cast<int>(n);
  fail("expected the number of a performer, 1 to 255");
}

bool JsonField::flag() const {
  if (value_->is_boolean()) return value_->get<bool>();
  fail("expected true or false");
}

std::string JsonField::text() const {
  if (value_->is_string()) return value_->get<std::string>();
  fail("expected a text");
}

Eigen::Vector3d JsonField::vector() const {
  const std::vector<JsonField> parts = value_->is_array() ? list() : std::vector<JsonField>{};
  if (parts.size() != 3) fail("expected three numbers, [x, y, z]");
  Eigen::Vector3d v;
  for (int k = 0; k < 3; ++k) v[k] = parts[static_cast<size_t>(k)].number(-kMaxMetres, kMaxMetres);
  return v;
}

std::filesystem::path JsonField::path(std::string_view document) const {
  const std::string name = text();
  if (name.empty() || name.front() == '/' || name.find_first_of(":?#\\%") != std::string::npos) {
    fail("expected a path from the folder of the " + std::string(document) +
         ", without any of : ? # % and backslash");
  }
  return (file_.parent_path() / name).lexically_normal();
}

Rgb8 JsonField::colour() const {
  const std::string name = text();
  const bool right = name.size() == 7 && name[0] == '#' &&
                     name.find_first_not_of("0123456789abcdefABCDEF", 1) == std::string::npos;
  if (!right) fail("expected a colour such as \"#101216\"");
  const auto part = [&](size_t at) {
    return static_cast<uint8_t>(std::stoi(name.substr(at, 2), nullptr, 16));
  };
  return {part(1), part(3), part(5)};
}

}  // namespace v3d::ctl
