#include <fmt/core.h>

#include <nlohmann/json.hpp>
#include <optional>
#include <vector>

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
  std::string text() const {
    return "        " + declaration_ + ".timeSamples = {\n" + text_ + "        }\n";
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
    if (pulse != *first_ && mesh.triangles == triangles_) return;
    triangles_ = mesh.triangles;
    counts_.add(pulse, counts_text(mesh));
    indices_.add(pulse, indices_text(mesh));
  }

  std::string finish() override {
    std::string text = header();
    for (const Samples* samples : {&extent_, &counts_, &indices_, &points_}) {
      text += samples->text();
    }
    if (has_colours_) {
      text +=
          "        color3f[] primvars:displayColor (\n            interpolation = \"vertex\"\n"
          "        )\n" +
          colours_.text();
    }
    return text +
           "        uniform token orientation = \"rightHanded\"\n"
           "        uniform token subdivisionScheme = \"none\"\n    }\n}\n";
  }

 private:
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
