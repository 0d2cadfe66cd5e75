#include <fmt/core.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <numeric>

#include "base/core/error.h"
#include "base/image/image_files.h"
#include "v3dctl/export/gltf_document.h"
#include "v3dctl/export/mesh_export.h"
#include "v3dctl/skeleton/take_skeleton.h"

namespace v3d::ctl {
namespace {

using Eigen::Isometry3d;
using Eigen::Quaterniond;
using Eigen::Vector3d;
using nlohmann::json;
using recon::Joint;

/// The frame of a joint: world_from_joint.
Isometry3d frame_of(const recon::SkeletonPulse& pulse, size_t joint) {
  Isometry3d frame = Isometry3d::Identity();
  frame.linear() = pulse.rotations[joint];
  frame.translation() = pulse.joints[joint];
  return frame;
}

/// In the frame of the parent `from`; the pelvis, its own parent, in the world.
Isometry3d local_frame(const recon::SkeletonPulse& pulse, Joint joint, Joint from) {
  const Isometry3d frame = frame_of(pulse, joint);
  return from == joint ? frame : frame_of(pulse, from).inverse() * frame;
}

void append(const Vector3d& v, std::vector<float>& values) {
  for (const double x : {v.x(), v.y(), v.z()}) values.push_back(static_cast<float>(x));
}
/// A unit quaternion; rounding keeps its components within -1 to 1.
void append(const Quaterniond& q, std::vector<float>& values) {
  for (const double x : {q.x(), q.y(), q.z(), q.w()}) {
    values.push_back(static_cast<float>(std::clamp(x, -1.0, 1.0)));
  }
}

class SkinnedScene {
 public:
  SkinnedScene(const TakeSkeleton& skeleton, const std::string& name,
               std::span<const recon::TextureAtlas> textures)
      : skeleton_(skeleton),
        textures_(textures),
        rate_hz_(skeleton.rate_hz > 0 ? skeleton.rate_hz : 25) {
    joints_ = skeleton.structure.has_prop ? size_t{recon::kJoints} : size_t{recon::kBodyJoints};
    out_.add_buffer();
    root_ = out_.add("nodes", {{"name", name}, {"rotation", y_up_rotation()}});
    out_.gltf()["scenes"][0]["nodes"].push_back(root_);
    out_.gltf()["nodes"][root_]["extras"] = {{"take", name}, {"rate_hz", skeleton.rate_hz}};
    if (textures_.empty()) material_ = out_.add_unlit_material();
  }

  std::string write() {
    for (size_t b = 0; b < skeleton_.tracked.size(); ++b) {
      if (!skeleton_.skins[b].influences.empty()) shown_.push_back(b);
    }
    if (shown_.empty()) {
      throw InputError("--export glb needs a tracked surface: " + (skeleton_.unused_motion.empty()
                                                                       ? "run v3dctl track first"
                                                                       : skeleton_.unused_motion));
    }
    for (size_t n = 0; n < shown_.size(); ++n) add_segment(n);
    animation_["name"] = "take";
    out_.add("animations", std::move(animation_));
    return out_.bytes();
  }

 private:
  const recon::TrackedBody& body(size_t n) const { return skeleton_.tracked[shown_[n]]; }

  float time_of(int64_t pulse) const {
    const int64_t first = skeleton_.tracked[shown_.front()].pulses.front();
    return static_cast<float>(static_cast<double>(pulse - first) / rate_hz_);
  }

  void add_segment(size_t n) {
    const recon::Skin& skin = skeleton_.skins[shown_[n]];
    const std::string name = fmt::format("{:06}", body(n).pulses.front());
    json armature = {{"name", "skeleton " + name}};
    if (n > 0) armature["scale"] = {0, 0, 0};
    const size_t top = out_.add("nodes", std::move(armature));
    out_.gltf()["nodes"][root_]["children"].push_back(top);
    const size_t first_joint = out_.gltf()["nodes"].size();
    for (size_t j = 0; j < joints_; ++j) add_joint(skin, static_cast<Joint>(j), top, first_joint);
    for (size_t j = 0; j < joints_; ++j) animate_joint(n, static_cast<Joint>(j), first_joint + j);
    animate_visibility(n, top);
    const size_t mesh = add_mesh(n, name);
    // At the root, because only its joints move a surface with a skin.
    out_.gltf()["scenes"][0]["nodes"].push_back(out_.add(
        "nodes",
        {{"name", "surface " + name}, {"mesh", mesh}, {"skin", add_skin(skin, top, first_joint)}}));
  }

  void add_joint(const recon::Skin& skin, Joint joint, size_t top, size_t first_joint) {
    const Joint from = skeleton_.structure.parent_of(joint);
    const Isometry3d local = local_frame(skin.rest, joint, from);
    std::vector<float> translation, turn;
    append(local.translation(), translation);
    append(Quaterniond(local.linear()), turn);
    const size_t node = out_.add(
        "nodes", {{"name", recon::name(joint)}, {"translation", translation}, {"rotation", turn}});
    out_.gltf()["nodes"][from == joint ? top : first_joint + from]["children"].push_back(node);
  }

  void animate_joint(size_t n, Joint joint, size_t node) {
    std::vector<float> times, translations, turns;
    Quaterniond before = Quaterniond::Identity();
    const Joint from = skeleton_.structure.parent_of(joint);
    const std::vector<recon::SkeletonPulse>& poses = skeleton_.skins[shown_[n]].poses;
    for (size_t p = 0; p < poses.size(); ++p) {
      const Isometry3d local = local_frame(poses[p], joint, from);
      Quaterniond turn(local.linear());
      if (turn.dot(before) < 0) turn.coeffs() *= -1;  // the short way between two keys
      before = turn;
      times.push_back(time_of(body(n).pulses[p]));
      append(local.translation(), translations);
      append(turn, turns);
    }
    out_.animate(animation_, node, "translation", "LINEAR", times, translations, 3);
    out_.animate(animation_, node, "rotation", "LINEAR", times, turns, 4);
  }

  /// A segment is shown until the next one begins. A skinned surface follows only its joints, so
  /// their scale hides it.
  void animate_visibility(size_t n, size_t top) {
    if (shown_.size() == 1) return;
    std::vector<float> times{0}, scales(3, n == 0 ? 1.0F : 0.0F);
    if (n > 0) {
      times.push_back(time_of(body(n).pulses.front()));
      scales.insert(scales.end(), 3, 1);
    }
    if (n + 1 < shown_.size()) {
      times.push_back(time_of(body(n + 1).pulses.front()));
      scales.insert(scales.end(), 3, 0);
    }
    out_.animate(animation_, top, "scale", "STEP", times, scales, 3);
  }

  size_t add_mesh(size_t n, const std::string& name) {
    return textures_.empty() ? add_coloured_mesh(n, name) : add_textured_mesh(n, name);
  }

  size_t add_coloured_mesh(size_t n, const std::string& name) {
    const Mesh& surface = body(n).surface;
    json attributes = json::object();
    if (!surface.colours.empty()) {
      attributes["COLOR_0"] = out_.add_attribute(linear_colours(surface), surface.vertices.size());
    }
    std::vector<uint32_t> vertices(surface.vertices.size());
    std::iota(vertices.begin(), vertices.end(), 0);
    return add_primitive(n, name, surface, vertices, std::move(attributes), material_);
  }

  size_t add_textured_mesh(size_t n, const std::string& name) {
    const recon::TextureAtlas& atlas = textures_[shown_[n]];
    const TexturedMesh textured = with_coordinates(body(n).surface, atlas.layout);
    const json attributes = {
        {"TEXCOORD_0", out_.add_attribute(texture_coordinates(textured), textured.source.size())}};
    const size_t material = out_.add_unlit_material();
    out_.set_texture(material, encode_jpeg(atlas.image.view(), MeshFileOptions().atlas_quality));
    return add_primitive(n, name, textured.mesh, textured.source, attributes, material);
  }

  /// `vertices`: of each vertex of the mesh, its number in the skin.
  size_t add_primitive(size_t n, const std::string& name, const Mesh& mesh,
                       const std::vector<uint32_t>& vertices, json attributes, size_t material) {
    attributes["POSITION"] = out_.add_attribute(float_positions(mesh), vertices.size());
    std::vector<uint8_t> joints;
    std::vector<float> weights;
    for (const uint32_t vertex : vertices) {
      const recon::SkinInfluence& influence = skeleton_.skins[shown_[n]].influences[vertex];
      for (size_t k = 0; k < recon::SkinInfluence::kParts; ++k) {
        const bool is_used = influence.weight[k] > 0;
        joints.push_back(is_used ? static_cast<uint8_t>(influence.part[k]) : uint8_t{0});
        weights.push_back(influence.weight[k]);
      }
    }
    VertexStream stream = make_stream("JOINTS_0", Component::kUint8, 4, joints);
    stream.normalised = false;
    attributes["JOINTS_0"] = out_.add_attribute(stream, vertices.size());
    attributes["WEIGHTS_0"] = out_.add_attribute(
        make_stream("WEIGHTS_0", Component::kFloat, 4, weights), vertices.size());
    std::vector<uint32_t> indices;
    for (const auto& triangle : mesh.triangles) {
      indices.insert(indices.end(), triangle.begin(), triangle.end());
    }
    const json primitive = {{"mode", kTriangles},
                            {"material", material},
                            {"attributes", attributes},
                            {"indices", out_.add_indices(indices)}};
    return out_.add("meshes", {{"name", name}, {"primitives", {primitive}}});
  }

  size_t add_skin(const recon::Skin& skin, size_t top, size_t first_joint) {
    std::vector<float> matrices;
    json joints = json::array();
    for (size_t j = 0; j < joints_; ++j) {
      const Eigen::Matrix4f inverse =
          frame_of(skin.rest, j).inverse().matrix().cast<float>();  // by columns, as glTF
      matrices.insert(matrices.end(), inverse.data(), inverse.data() + inverse.size());
      joints.push_back(first_joint + j);
    }
    return out_.add("skins", {{"skeleton", top},
                              {"joints", joints},
                              {"inverseBindMatrices", out_.add_floats(matrices, 16, false)}});
  }

  const TakeSkeleton& skeleton_;
  std::span<const recon::TextureAtlas> textures_;  ///< of each body; none: colours of vertices
  double rate_hz_;
  size_t joints_ = 0;
  std::vector<size_t> shown_;  ///< bodies with a skin
  GltfDocument out_;
  size_t root_ = 0;
  size_t material_ = 0;  ///< of coloured meshes
  json animation_;
};

}  // namespace

std::string skeleton_glb(const TakeSkeleton& skeleton, const std::string& name,
                         std::span<const recon::TextureAtlas> textures) {
  return SkinnedScene(skeleton, name, textures).write();
}

}  // namespace v3d::ctl
