#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <optional>
#include <utility>
#include <vector>

#include "base/core/error.h"
#include "v3dctl/export/gltf_document.h"
#include "v3dctl/export/surface_sequence.h"

namespace v3d::ctl {
namespace {

using nlohmann::json;

/// Limit of morph targets of a mesh: three.js keeps them in the layers of a texture, of which
/// WebGL 2 guarantees 256.
constexpr size_t kMaxTargets = 255;
constexpr double kMaxColour = 65535;

std::string name_of(int64_t pulse) { return fmt::format("{:06}", pulse); }

/// Surfaces with equal triangles.
struct MorphGroup {
  std::vector<int64_t> pulses;
  Mesh first;
  std::vector<float> colour_sums;  ///< linear light and alpha of each vertex, up to kMaxColour
  json targets = json::array();

  bool continues_with(const Mesh& mesh) const {
    return !mesh.triangles.empty() && pulses.size() <= kMaxTargets &&
           mesh.vertices.size() == first.vertices.size() &&
           mesh.colours.size() == first.colours.size() && mesh.triangles == first.triangles;
  }
};

/// A surface that is shown from its first pulse until that of the next one.
struct ShownNode {
  std::optional<size_t> node;  ///< none: an empty surface
  std::vector<int64_t> pulses;
};

class GlbSequence : public SurfaceSequence {
 public:
  explicit GlbSequence(const SequenceOptions& options) : options_(options) {
    out_.add_buffer();
    root_ = out_.add("nodes", {{"name", options.take}, {"rotation", y_up_rotation()}});
    out_.gltf()["scenes"][0]["nodes"].push_back(root_);
  }

  void add(int64_t pulse, const Mesh& mesh) override {
    if (group_ && group_->continues_with(mesh)) {
      group_->targets.push_back({{"POSITION", add_target(mesh)}});
      require_room(pulse);
    } else {
      close_group();
      group_.emplace();
      group_->first = mesh;
    }
    group_->pulses.push_back(pulse);
    add_colours(mesh);
  }

  std::string finish() override {
    close_group();
    for (size_t n = 0; n < shown_.size(); ++n) {
      if (!shown_[n].node) continue;
      animate_scale(n);
      animate_weights(shown_[n]);
    }
    if (!animation_.is_null()) {
      animation_["name"] = options_.take;
      out_.add("animations", std::move(animation_));
    }
    add_extras();
    return out_.bytes();
  }

 private:
  /// `pulse`: the last one in the file. An export of hours of a take would otherwise fill the
  /// memory before it fails.
  void require_room(int64_t pulse) const {
    if (out_.buffer_bytes() <= options_.max_glb_bytes) return;
    throw InputError(fmt::format(
        "a GLB file contains at most {:.3g} GB, which the surfaces up to pulse {} exceed; expected "
        "fewer --frames",
        1e-9 * static_cast<double>(options_.max_glb_bytes), pulse));
  }

  /// The displacements of all vertices.
  size_t add_target(const Mesh& mesh) {
    Mesh difference;
    for (size_t v = 0; v < mesh.vertices.size(); ++v) {
      difference.vertices.emplace_back(mesh.vertices[v] - group_->first.vertices[v]);
    }
    return out_.add_attribute(float_positions(difference), difference.vertices.size());
  }

  void add_colours(const Mesh& mesh) {
    std::vector<float> colours = linear_light<float>(mesh, 4, kMaxColour);
    std::vector<float>& sums = group_->colour_sums;
    sums.resize(colours.size(), 0);
    std::transform(colours.begin(), colours.end(), sums.begin(), sums.begin(), std::plus<>());
  }

  void close_group() {
    if (!group_) return;
    const MorphGroup group = *std::move(group_);
    group_.reset();
    ShownNode& shown = shown_.emplace_back();
    shown.pulses = group.pulses;
    if (group.first.triangles.empty()) return;
    const std::string name = name_of(group.pulses.front());
    json node = {{"name", name}, {"mesh", add_mesh(group, name)}};
    require_room(group.pulses.back());
    if (has_node()) node["scale"] = {0, 0, 0};  // the first surface is shown without animation
    const int64_t pulse = group.pulses.front();
    if (const auto timecode = timecode_of(pulse))
      node["extras"] = timecode_extras(pulse, *timecode);
    shown.node = out_.add("nodes", std::move(node));
    out_.gltf()["nodes"][root_]["children"].push_back(*shown.node);
  }

  bool has_node() const {
    return std::ranges::any_of(shown_, [](const ShownNode& shown) { return !!shown.node; });
  }

  std::optional<take::PulseTimecode> timecode_of(int64_t pulse) const {
    return options_.timecode ? options_.timecode(pulse) : std::nullopt;
  }

  size_t add_mesh(const MorphGroup& group, const std::string& name) {
    json primitive = {{"mode", kTriangles}, {"material", material()}};
    const size_t vertices = group.first.vertices.size();
    primitive["attributes"]["POSITION"] =
        out_.add_attribute(float_positions(group.first), vertices);
    if (!group.first.colours.empty()) {
      primitive["attributes"]["COLOR_0"] = out_.add_attribute(mean_colours(group), vertices);
    }
    std::vector<uint32_t> indices;
    for (const auto& triangle : group.first.triangles) {
      indices.insert(indices.end(), triangle.begin(), triangle.end());
    }
    primitive["indices"] = out_.add_indices(indices);
    json mesh;
    mesh["name"] = name;
    if (!group.targets.empty()) {
      primitive["targets"] = group.targets;
      mesh["weights"] = std::vector<int>(group.targets.size(), 0);
      for (size_t n = 1; n < group.pulses.size(); ++n) {
        mesh["extras"]["targetNames"].push_back(name_of(group.pulses[n]));
      }
    }
    mesh["primitives"].push_back(std::move(primitive));
    return out_.add("meshes", std::move(mesh));
  }

  static VertexStream mean_colours(const MorphGroup& group) {
    std::vector<uint16_t> values;
    const auto count = static_cast<float>(group.pulses.size());
    for (const float sum : group.colour_sums) {
      values.push_back(static_cast<uint16_t>(std::lround(sum / count)));
    }
    return make_stream("COLOR_0", Component::kUint16, 4, values);
  }

  size_t material() {
    if (!material_) material_ = out_.add_unlit_material();
    return *material_;
  }

  /// Seconds after the first pulse of the file.
  float time_of(int64_t pulse) const {
    const auto after = static_cast<double>(pulse - shown_.front().pulses.front());
    return static_cast<float>(after / (options_.rate_hz > 0 ? options_.rate_hz : 25));
  }

  void animate_scale(size_t n) {
    std::vector<float> times{time_of(shown_[n].pulses.front())}, values{1};
    if (n > 0) {
      times.insert(times.begin(), 0);
      values.insert(values.begin(), 0);
    }
    const bool is_last = n + 1 == shown_.size();
    times.push_back(is_last ? time_of(shown_[n].pulses.back() + 1)
                            : time_of(shown_[n + 1].pulses.front()));
    values.push_back(is_last ? 1 : 0);
    std::vector<float> scales;
    for (const float value : values) scales.insert(scales.end(), 3, value);
    out_.animate(animation_, *shown_[n].node, "scale", "STEP", times, scales, 3);
  }

  /// At pulse n of the mesh, the weight of target n - 1 is 1.
  void animate_weights(const ShownNode& shown) {
    const size_t targets = shown.pulses.size() - 1;
    if (targets == 0) return;
    std::vector<float> times, weights(shown.pulses.size() * targets, 0);
    for (const int64_t pulse : shown.pulses) times.push_back(time_of(pulse));
    for (size_t n = 1; n <= targets; ++n) weights[n * targets + n - 1] = 1;
    out_.animate(animation_, *shown.node, "weights", "LINEAR", times, weights, 1);
  }

  void add_extras() {
    json& extras = out_.gltf()["nodes"][root_]["extras"];
    extras = {{"take", options_.take}, {"rate_hz", options_.rate_hz}, {"pulses", json::array()}};
    for (const ShownNode& shown : shown_) {
      for (const int64_t pulse : shown.pulses) extras["pulses"].push_back(pulse);
    }
    if (const auto timecode = timecode_of(shown_.front().pulses.front())) {
      extras["first_timecode"] = timecode->text();
      extras["timecode_rate"] = name(timecode->rate);
    }
    if (!material_) out_.gltf().erase("buffers");  // no surface at all
  }

  SequenceOptions options_;
  GltfDocument out_;
  size_t root_ = 0;
  std::optional<size_t> material_;
  std::optional<MorphGroup> group_;  ///< not written yet, but for its targets
  std::vector<ShownNode> shown_;
  json animation_;
};

}  // namespace

std::unique_ptr<SurfaceSequence> make_glb_sequence(const SequenceOptions& options) {
  return std::make_unique<GlbSequence>(options);
}

}  // namespace v3d::ctl
