// A field of a JSON file that a person writes; errors name the file and the field.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "base/geometry/mesh.h"

namespace v3d::ctl {

/// A JSON value, which is borrowed, and its path in the file. All functions throw InputError when
/// the value is not what they return.
class JsonField {
 public:
  JsonField(const nlohmann::json& value, std::filesystem::path file, std::string where)
      : value_(&value), file_(std::move(file)), where_(std::move(where)) {}

  [[noreturn]] void fail(const std::string& what) const;
  /// An object without keys that are not in `known`.
  void expect_object(const std::set<std::string>& known) const;
  /// The field of an object; find(): empty where there is none.
  std::optional<JsonField> find(const std::string& key) const;
  JsonField at(const std::string& key) const;
  std::vector<JsonField> list() const;

  double number(double min, double max) const;
  double positive() const;  ///< at most 1000
  int64_t integer(int64_t min, int64_t max) const;
  int64_t pulse() const;
  int performer() const;
  bool flag() const;
  std::string text() const;
  Eigen::Vector3d vector() const;
  /// Path of a file below the folder of this one. `document`: what the file is, for the message.
  std::filesystem::path path(std::string_view document) const;
  Rgb8 colour() const;

 private:
  const nlohmann::json* value_;
  std::filesystem::path file_;
  std::string where_;
};

}  // namespace v3d::ctl
