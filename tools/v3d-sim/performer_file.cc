#include "v3d-sim/performer_file.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>
#include <vector>

#include "base/core/error.h"
#include "gltf/gltf_file.h"

namespace v3d::sim {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3f;

constexpr size_t kMaxNodes = 10'000;
constexpr size_t kMaxJoints = 1'000;
constexpr size_t kMaxVertices = 1'000'000;
constexpr size_t kMaxTriangles = 2'000'000;
constexpr double kMinHeight = 0.5, kMaxHeight = 2.4;      // metres
constexpr double kHalfWidth = 1.5, kStudioHeight = 2.45;  // of the space in studio.toml, metres

std::string at(const char* list, int index) { return fmt::format("{}[{}]", list, index); }

/// Reads one file into a SkinnedBody.
class Reader {
 public:
  Reader(GltfFile file, const std::string& animation) : file_(std::move(file)) {
    read_nodes();
    read_meshes();
    read_animation(animation);
  }

  std::shared_ptr<const SkinnedModel> model() {
    auto model = std::make_shared<const SkinnedModel>(std::move(body_));
    check(*model);
    return model;
  }

 private:
  const tinygltf::Model& gltf() const { return file_.model(); }

  void read_nodes() {
    if (gltf().nodes.size() > kMaxNodes) file_.fail("has too many nodes: more than 10,000");
    body_.nodes.resize(gltf().nodes.size());
    for (size_t n = 0; n < body_.nodes.size(); ++n) {
      const tinygltf::Node& from = gltf().nodes[n];
      const GltfNodeTransform transform = transform_of(from);
      SkeletonNode& node = body_.nodes[n];
      node.name = from.name;
      node.translation = transform.translation;
      node.rotation = transform.rotation;
      node.scale = transform.scale;
      node.matrix = transform.matrix;
      for (const int child : from.children) {
        file_.of(gltf().nodes, child);
        body_.nodes[static_cast<size_t>(child)].parent = static_cast<int>(n);
      }
    }
  }

  void read_meshes() {
    if (gltf().skins.empty()) {
      file_.fail("has no skin; expected a mesh whose vertices follow the joints of a skeleton");
    }
    for (const tinygltf::Node& node : gltf().nodes) {
      if (node.mesh < 0 || node.skin < 0) continue;
      const SkinJoints joints = read_skin(node.skin);
      const auto& primitives = file_.of(gltf().meshes, node.mesh).primitives;
      for (size_t p = 0; p < primitives.size(); ++p) {
        read_primitive(primitives[p], joints,
                       fmt::format("meshes[{}].primitives[{}]", node.mesh, p));
      }
    }
    if (!has_surface_) {
      file_.fail("has no triangles of a skinned mesh; expected a node with `mesh` and `skin`");
    }
  }

  /// The joints of a skin in SkinnedBody::joints.
  struct SkinJoints {
    size_t first = 0, count = 0;
  };

  SkinJoints read_skin(int index) {
    if (const auto known = skins_.find(index); known != skins_.end()) return known->second;
    const tinygltf::Skin& skin = file_.of(gltf().skins, index);
    const SkinJoints joints{body_.joints.size(), skin.joints.size()};
    if (joints.count == 0) file_.fail(at("skins", index) + " has no joints; expected one or more");
    if (joints.first + joints.count > kMaxJoints) {
      file_.fail(at("skins", index) + ": more than 1,000 joints together");
    }
    std::vector<float> matrices;
    if (skin.inverseBindMatrices >= 0) {
      matrices = file_.numbers(skin.inverseBindMatrices, 16,
                               at("skins", index) + ".inverseBindMatrices", "joint");
      if (matrices.size() < 16 * joints.count) {
        file_.fail(fmt::format("skins[{}].inverseBindMatrices: {} for {} joints; expected one each",
                               index, matrices.size() / 16, joints.count));
      }
    }
    for (size_t j = 0; j < joints.count; ++j) {
      SkinJoint& joint = body_.joints.emplace_back();
      file_.of(gltf().nodes, skin.joints[j]);
      joint.node = static_cast<size_t>(skin.joints[j]);
      if (matrices.empty()) continue;
      joint.node_from_mesh.matrix() =
          Eigen::Map<const Eigen::Matrix4f>(&matrices[16 * j]).cast<double>();
      joint.node_from_mesh.makeAffine();
    }
    return skins_.emplace(index, joints).first->second;
  }

  /// The accessor of an attribute that must exist.
  int attribute(const tinygltf::Primitive& primitive, const char* name,
                const std::string& where) const {
    const auto found = primitive.attributes.find(name);
    if (found == primitive.attributes.end()) {
      file_.fail(
          fmt::format("{}: has no {}; expected POSITION, JOINTS_0 and WEIGHTS_0", where, name));
    }
    return found->second;
  }

  void read_primitive(const tinygltf::Primitive& primitive, const SkinJoints& joints,
                      const std::string& where) {
    if (primitive.mode != TINYGLTF_MODE_TRIANGLES) {
      file_.fail(fmt::format("{}: has mode {}; expected 4, triangles", where, primitive.mode));
    }
    if (primitive.attributes.contains("JOINTS_1")) {
      file_.fail(where + ": has JOINTS_1; expected at most 4 joints for each vertex");
    }
    const auto positions =
        file_.numbers(attribute(primitive, "POSITION", where), 3, where + ": POSITION");
    const auto numbers =
        file_.integers(attribute(primitive, "JOINTS_0", where), 4, where + ": JOINTS_0");
    const auto weights =
        file_.numbers(attribute(primitive, "WEIGHTS_0", where), 4, where + ": WEIGHTS_0");
    const size_t count = positions.size() / 3, first = body_.positions.size();
    if (numbers.size() != 4 * count || weights.size() != 4 * count) {
      file_.fail(fmt::format(
          "{}: {} positions, {} rows of JOINTS_0 and {} of WEIGHTS_0; expected equal counts", where,
          count, numbers.size() / 4, weights.size() / 4));
    }
    if (count > kMaxVertices - first) file_.fail(where + ": more than 1,000,000 vertices together");
    for (size_t v = 0; v < count; ++v) {
      body_.positions.emplace_back(positions[3 * v], positions[3 * v + 1], positions[3 * v + 2]);
      body_.weights.push_back(skin_weights(&numbers[4 * v], &weights[4 * v], joints,
                                           fmt::format("{}: vertex {}", where, v)));
    }
    read_triangles(primitive, first, count, where);
  }

  SkinWeights skin_weights(const uint32_t* numbers, const float* weights, const SkinJoints& joints,
                           const std::string& where) const {
    SkinWeights skin;
    skin.weights = Eigen::Map<const Eigen::Vector4f>(weights);
    if (!((skin.weights.array() >= 0).all() && skin.weights.sum() > 0)) {
      file_.fail(where + " has weights that are negative or all 0; expected a sum of 1");
    }
    skin.weights /= skin.weights.sum();
    for (size_t k = 0; k < 4; ++k) {
      if (skin.weights[static_cast<int>(k)] == 0) continue;
      if (numbers[k] >= joints.count) {
        file_.fail(fmt::format("{} names joint {}; the skin has {} joints, from 0", where,
                               numbers[k], joints.count));
      }
      skin.joints[k] = static_cast<uint32_t>(joints.first + numbers[k]);
    }
    return skin;
  }

  void read_triangles(const tinygltf::Primitive& primitive, size_t first, size_t count,
                      const std::string& where) {
    std::vector<uint32_t> corners;
    if (primitive.indices >= 0) {
      corners = file_.integers(primitive.indices, 1, where + ": indices");
    } else {
      for (uint32_t v = 0; v < count; ++v) corners.push_back(v);
    }
    if (corners.size() / 3 > kMaxTriangles - body_.triangles.size()) {
      file_.fail(where + ": more than 2,000,000 triangles together");
    }
    for (size_t n = 0; n + 3 <= corners.size(); n += 3) {
      std::array<uint32_t, 3> triangle{};
      for (size_t k = 0; k < 3; ++k) {
        if (corners[n + k] >= count) {
          file_.fail(fmt::format("{}: index {} names vertex {}; there are {} vertices, from 0",
                                 where, n + k, corners[n + k], count));
        }
        triangle[k] = static_cast<uint32_t>(first + corners[n + k]);
      }
      body_.triangles.push_back(triangle);
      const auto& p = body_.positions;
      has_surface_ =
          has_surface_ || (p[triangle[0]] != p[triangle[1]] && p[triangle[1]] != p[triangle[2]] &&
                           p[triangle[2]] != p[triangle[0]]);
    }
  }

  void read_animation(const std::string& name) {
    const auto& animations = gltf().animations;
    if (animations.empty()) file_.fail("has no animation; expected one that moves the skeleton");
    auto found = animations.begin();
    if (!name.empty()) found = std::ranges::find(animations, name, &tinygltf::Animation::name);
    if (found == animations.end()) {
      std::string names;
      for (const auto& animation : animations)
        names += (names.empty() ? "" : ", ") + animation.name;
      file_.fail("has no animation '" + name + "'; it has " + names);
    }
    const std::string where = at("animations", static_cast<int>(found - animations.begin()));
    for (size_t c = 0; c < found->channels.size(); ++c) {
      read_channel(*found, found->channels[c], fmt::format("{}.channels[{}]", where, c));
    }
  }

  void read_channel(const tinygltf::Animation& animation, const tinygltf::AnimationChannel& channel,
                    const std::string& where) {
    const std::string& path = channel.target_path;
    if (channel.target_node < 0 || path == "weights") return;
    file_.of(gltf().nodes, channel.target_node);
    SkeletonNode& node = body_.nodes[static_cast<size_t>(channel.target_node)];
    if (node.matrix) {
      file_.fail(
          fmt::format("{}: moves nodes[{}], which has a matrix; expected translation, "
                      "rotation and scale",
                      where, channel.target_node));
    }
    const tinygltf::AnimationSampler& sampler = file_.of(animation.samplers, channel.sampler);
    if (path == "translation") {
      node.translations = vector_track(sampler, where);
    } else if (path == "scale") {
      node.scales = vector_track(sampler, where);
    } else if (path == "rotation") {
      node.rotations = rotation_track(sampler, where);
    } else {
      file_.fail(where + ": has the path '" + path + "'; expected translation, rotation or scale");
    }
  }

  template <class Value>
  AnimationTrack<Value> empty_track(const tinygltf::AnimationSampler& sampler,
                                    const std::string& where) {
    AnimationTrack<Value> track;
    track.steps = sampler.interpolation == "STEP";
    if (!track.steps && sampler.interpolation != "LINEAR") {
      file_.fail(where + ": has the interpolation '" + sampler.interpolation +
                 "'; expected LINEAR or STEP: export the animation with a key for each frame");
    }
    for (const float time : file_.numbers(sampler.input, 1, where + ": times", "key")) {
      if (!track.seconds.empty() && !(time > track.seconds.back())) {
        file_.fail(
            fmt::format("{}: key {} is not after the key before it; expected times that "
                        "ascend",
                        where, track.seconds.size()));
      }
      track.seconds.push_back(time);
    }
    return track;
  }

  /// The values of a sampler: `width` numbers for each key.
  std::vector<float> values(const tinygltf::AnimationSampler& sampler, size_t width, size_t keys,
                            const std::string& where) {
    std::vector<float> values = file_.numbers(sampler.output, width, where + ": values", "key");
    if (keys == 0 || values.size() != width * keys) {
      file_.fail(fmt::format("{}: {} times and {} values; expected one value for each time", where,
                             keys, values.size() / width));
    }
    return values;
  }

  AnimationTrack<Vector3d> vector_track(const tinygltf::AnimationSampler& sampler,
                                        const std::string& where) {
    auto track = empty_track<Vector3d>(sampler, where);
    const std::vector<float> numbers = values(sampler, 3, track.seconds.size(), where);
    for (size_t n = 0; n < numbers.size(); n += 3) {
      track.values.emplace_back(numbers[n], numbers[n + 1], numbers[n + 2]);
    }
    return track;
  }

  AnimationTrack<Eigen::Quaterniond> rotation_track(const tinygltf::AnimationSampler& sampler,
                                                    const std::string& where) {
    auto track = empty_track<Eigen::Quaterniond>(sampler, where);
    const std::vector<float> xyzw = values(sampler, 4, track.seconds.size(), where);
    for (size_t n = 0; n < xyzw.size(); n += 4) {
      const Eigen::Quaterniond turn(xyzw[n + 3], xyzw[n], xyzw[n + 1], xyzw[n + 2]);
      if (!(turn.norm() > 0.5 && turn.norm() < 2)) {
        file_.fail(fmt::format("{}: key {} has a quaternion of length {:.3g}; expected 1", where,
                               n / 4, turn.norm()));
      }
      track.values.push_back(turn.normalized());
    }
    return track;
  }

  void check(const SkinnedModel& model) const {
    const Eigen::AlignedBox3d& extent = model.extent();
    if (extent.isEmpty()) {
      file_.fail("moves vertices to positions that are not finite; expected finite transforms");
    }
    if (!(model.height_m() >= kMinHeight && model.height_m() <= kMaxHeight)) {
      file_.fail(
          fmt::format("is {:.3g} m high at the first key; expected a body of {} to {} m: "
                      "scale it to metres, y up",
                      model.height_m(), kMinHeight, kMaxHeight));
    }
    const double side =
        std::max(extent.max().head<2>().maxCoeff(), -extent.min().head<2>().minCoeff());
    if (!(side <= kHalfWidth && extent.max().z() <= kStudioHeight)) {
      file_.fail(
          fmt::format("reaches {:.2f} m to a side and {:.2f} m up in this animation; "
                      "expected at most {} m and {} m, the space of the studio",
                      side, extent.max().z(), kHalfWidth, kStudioHeight));
    }
  }

  GltfFile file_;
  SkinnedBody body_;
  std::map<int, SkinJoints> skins_;
  bool has_surface_ = false;
};

}  // namespace

std::shared_ptr<const SkinnedModel> load_performer(const std::filesystem::path& path,
                                                   const std::string& animation) {
  return Reader(GltfFile::open(path), animation).model();
}

std::shared_ptr<const SkinnedModel> parse_performer(std::string_view bytes,
                                                    const std::filesystem::path& path,
                                                    const std::string& animation) {
  return Reader(GltfFile(bytes, path), animation).model();
}

}  // namespace v3d::sim
