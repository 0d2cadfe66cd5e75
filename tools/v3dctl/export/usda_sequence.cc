#include <fmt/core.h>

#include <nlohmann/json.hpp>
#include <optional>
#include <vector>

#include "base/core/error.h"
#include "base/core/text.h"
#include "recon/render/renderer.h"
#include "v3dctl/export/surface_sequence.h"
#include "v3dctl/export/vertex_streams.h"

namespace v3d::ctl {
namespace {

/// "[(x, y, z), ...]" with the shortest numbers that read back to the same floats.
class TupleText {
 public:
  void add(const Eigen::Vector3f& v) {
    text_ += fmt::format("{}({}, {}, {})", text_.empty() ? "" : ", ", v.x(), v.y(), v.z());
  }
  std::string array() const { return "[" + text_ + "]"; }

 private:
  std::string text_;
};

std::string points_text(const Mesh& mesh) {
  TupleText text;
  for (const Eigen::Vector3f& vertex : mesh.vertices) text.add(vertex);
  return text.array();
}

/// Linear light with four digits, which distinguish all values of sRGB.
std::string colours_text(const Mesh& mesh) {
  std::string text = "[";
  for (const Rgb8 c : mesh.colours) {
    text += fmt::format("{}({:.4g}, {:.4g}, {:.4g})", text.size() == 1 ? "" : ", ",
                        linear_light(c.r), linear_light(c.g), linear_light(c.b));
  }
  return text + "]";
}

std::string extent_text(const Mesh& mesh) {
  const Box box = recon::bounds_of(mesh);
  TupleText text;
  text.add(box.min.cast<float>());
  text.add(box.max.cast<float>());
  return text.array();
}

std::string counts_text(const Mesh& mesh) {
  std::string text = "[";
  for (size_t t = 0; t < mesh.triangles.size(); ++t) text += t == 0 ? "3" : ", 3";
  return text + "]";
}

std::string indices_text(const Mesh& mesh) {
  std::string text = "[";
  for (const auto& [a, b, c] : mesh.triangles) {
    text += fmt::format("{}{}, {}, {}", text.size() == 1 ? "" : ", ", a, b, c);
  }
  return text + "]";
}

/// An attribute with its time samples.
class Samples {
 public:
  explicit Samples(std::string declaration) : declaration_(std::move(declaration)) {}
  void add(int64_t time, const std::string& value) {
    text_ += fmt::format("            {}: {},\n", time, value);
  }
  uint64_t bytes() const { return text_.size(); }
  /// Frees the memory of the samples. No add() afterwards.
  void move_to(std::string& text) {
    text.append("        ").append(declaration_).append(".timeSamples = {\n").append(text_);
    text += "        }\n";
    text_ = std::string();
  }

 private:
  std::string declaration_, text_;
};

class UsdaSequence : public SurfaceSequence {
 public:
  explicit UsdaSequence(const SequenceOptions& options) : options_(options) {}

  void add(int64_t pulse, const Mesh& mesh) override {
    if (!first_) first_ = pulse;
    last_ = pulse;
    points_.add(pulse, points_text(mesh));
    extent_.add(pulse, extent_text(mesh));
    if (!mesh.colours.empty()) has_colours_ = true;
    colours_.add(pulse, colours_text(mesh));
    if (pulse == *first_ || mesh.triangles != triangles_) {
      triangles_ = mesh.triangles;
      counts_.add(pulse, counts_text(mesh));
      indices_.add(pulse, indices_text(mesh));
    }
    require_room();
  }

  std::string finish() override {
    constexpr size_t kFraming = 1000;  // around the samples
    std::string text = header();
    text.reserve(text.size() + sample_bytes() + kFraming);
    for (Samples* const samples : {&extent_, &counts_, &indices_, &points_}) samples->move_to(text);
    if (has_colours_) {
      text +=
          "        color3f[] primvars:displayColor (\n            interpolation = \"vertex\"\n"
          "        )\n";
      colours_.move_to(text);
    }
    text +=
        "        uniform token orientation = \"rightHanded\"\n"
        "        uniform token subdivisionScheme = \"none\"\n    }\n}\n";
    return text;
  }

 private:
  uint64_t sample_bytes() const {
    return extent_.bytes() + counts_.bytes() + indices_.bytes() + points_.bytes() +
           colours_.bytes();
  }

  /// An export of minutes of a take would otherwise fill the memory, which may end other programs.
  void require_room() const {
    if (sample_bytes() <= options_.max_usda_bytes) return;
    throw InputError(fmt::format(
        "the surfaces up to pulse {} have {} of text, more than the memory permits ({}); expected "
        "fewer --frames, or --format glb-sequence",
        last_, format_bytes(static_cast<double>(sample_bytes())),
        format_bytes(static_cast<double>(options_.max_usda_bytes))));
  }

  std::string header() const {
    const double rate = options_.rate_hz > 0 ? options_.rate_hz : 25;
    return fmt::format(
        "#usda 1.0\n(\n    defaultPrim = \"take\"\n    doc = {0}\n    endTimeCode = {1}\n"
        "    framesPerSecond = {2}\n    metersPerUnit = 1\n    startTimeCode = {3}\n"
        "    timeCodesPerSecond = {2}\n    upAxis = \"Z\"\n)\n\n"
        "def Xform \"take\"\n{{\n    def Mesh \"surface\"\n    {{\n",
        nlohmann::json("take " + options_.take).dump(), last_, rate, first_.value_or(0));
  }

  SequenceOptions options_;
  std::optional<int64_t> first_;
  int64_t last_ = 0;
  bool has_colours_ = false;
  std::vector<std::array<uint32_t, 3>> triangles_;
  Samples points_{"point3f[] points"}, extent_{"float3[] extent"};
  Samples counts_{"int[] faceVertexCounts"}, indices_{"int[] faceVertexIndices"};
  Samples colours_{"color3f[] primvars:displayColor"};
};

}  // namespace

std::unique_ptr<SurfaceSequence> make_usda_sequence(const SequenceOptions& options) {
  return std::make_unique<UsdaSequence>(options);
}

}  // namespace v3d::ctl
