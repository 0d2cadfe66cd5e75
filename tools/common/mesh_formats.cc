#include "common/mesh_formats.h"

#include <tiny_obj_loader.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <map>
#include <sstream>
#include <string>

#include "base/core/error.h"
#include "base/io/file.h"

namespace v3d {
namespace {

static_assert(std::endian::native == std::endian::little, "PLY is read as it lies in memory");

enum class Type { kInt8, kUint8, kInt16, kUint16, kInt32, kUint32, kFloat, kDouble };

struct Property {
  std::string name;
  Type type = Type::kFloat;
  bool is_list = false;
  Type count_type = Type::kUint8;
};

struct Element {
  std::string name;
  uint64_t count = 0;
  std::vector<Property> properties;
};

size_t size_of(Type type) {
  constexpr size_t kSizes[] = {1, 1, 2, 2, 4, 4, 4, 8};
  return kSizes[static_cast<size_t>(type)];
}

// The bytes after the header. Every read is checked against the end of the file.
class Body {
 public:
  Body(std::string_view bytes, const std::string& name) : remaining_(bytes), name_(name) {}

  double read(Type type) {
    switch (type) {
      case Type::kInt8:
        return take<int8_t>();
      case Type::kUint8:
        return take<uint8_t>();
      case Type::kInt16:
        return take<int16_t>();
      case Type::kUint16:
        return take<uint16_t>();
      case Type::kInt32:
        return take<int32_t>();
      case Type::kUint32:
        return take<uint32_t>();
      case Type::kFloat:
        return static_cast<double>(take<float>());
      case Type::kDouble:
        return take<double>();
    }
    return 0;
  }

  size_t left() const { return remaining_.size(); }
  [[noreturn]] void fail(const std::string& why) const { throw InputError(name_ + ": " + why); }

 private:
  template <class T>
  T take() {
    if (remaining_.size() < sizeof(T)) fail("the PLY file is truncated");
    T value;
    std::memcpy(&value, remaining_.data(), sizeof value);
    remaining_.remove_prefix(sizeof value);
    return value;
  }

  std::string_view remaining_;
  const std::string& name_;
};

Type parse_type(const std::string& word, const std::string& name) {
  static const std::map<std::string, Type> kTypes = {
      {"char", Type::kInt8},     {"int8", Type::kInt8},     {"uchar", Type::kUint8},
      {"uint8", Type::kUint8},   {"short", Type::kInt16},   {"int16", Type::kInt16},
      {"ushort", Type::kUint16}, {"uint16", Type::kUint16}, {"int", Type::kInt32},
      {"int32", Type::kInt32},   {"uint", Type::kUint32},   {"uint32", Type::kUint32},
      {"float", Type::kFloat},   {"float32", Type::kFloat}, {"double", Type::kDouble},
      {"float64", Type::kDouble}};
  const auto found = kTypes.find(word);
  if (found == kTypes.end()) throw InputError(name + ": unknown PLY type '" + word + "'");
  return found->second;
}

Property parse_property(std::istringstream& words, const std::string& name) {
  Property property;
  std::string type;
  words >> type;
  if (type == "list") {
    property.is_list = true;
    std::string count_type;
    words >> count_type >> type;
    property.count_type = parse_type(count_type, name);
  }
  property.type = parse_type(type, name);
  words >> property.name;
  return property;
}

// Removes the first line and its end from `remaining`. Returns false when there is none.
bool next_line(std::string_view& remaining, std::string& line) {
  const size_t end = remaining.find('\n');
  if (end == std::string_view::npos) return false;
  line = remaining.substr(0, end);
  remaining.remove_prefix(end + 1);
  return true;
}

// Parses the header and removes it from `remaining`.
std::vector<Element> parse_header(std::string_view& remaining, const std::string& name) {
  std::vector<Element> elements;
  std::string line;
  bool binary = false;
  if (!next_line(remaining, line) || (line != "ply" && line != "ply\r"))
    throw InputError(name + ": is not a PLY file");
  while (next_line(remaining, line)) {
    std::istringstream words(line);
    std::string keyword;
    words >> keyword;
    if (keyword == "end_header") {
      if (!binary) throw InputError(name + ": expected PLY format binary_little_endian 1.0");
      return elements;
    }
    if (keyword == "format") {
      std::string format;
      words >> format;
      binary = format == "binary_little_endian";
    } else if (keyword == "element") {
      Element element;
      if (!(words >> element.name >> element.count)) {
        throw InputError(name + ": invalid line in the PLY header: '" + line + "'");
      }
      elements.push_back(element);
    } else if (keyword == "property" && !elements.empty()) {
      elements.back().properties.push_back(parse_property(words, name));
    }
  }
  throw InputError(name + ": the PLY header has no end");
}

// All numbers of one element, by property. The first number of a list is its length.
using Values = std::vector<std::vector<double>>;

void read_element(Body& body, const Element& element, Values& values) {
  values.resize(element.properties.size());
  for (size_t i = 0; i < element.properties.size(); ++i) {
    const Property& property = element.properties[i];
    double count = 1;
    if (property.is_list) count = body.read(property.count_type);
    if (!(count >= 0) ||
        count * static_cast<double>(size_of(property.type)) > static_cast<double>(body.left())) {
      body.fail("the PLY file is truncated");
    }
    values[i].resize(static_cast<size_t>(count));
    for (double& value : values[i]) value = body.read(property.type);
  }
}

int find_property(const Element& element, std::initializer_list<const char*> names) {
  for (size_t i = 0; i < element.properties.size(); ++i) {
    for (const char* name : names) {
      if (element.properties[i].name == name) return static_cast<int>(i);
    }
  }
  return -1;
}

double scalar(const Values& values, int property) {
  const std::vector<double>& all = values[static_cast<size_t>(property)];
  return all.empty() ? 0 : all.front();
}

void read_vertices(Body& body, const Element& element, Mesh& mesh) {
  const int x = find_property(element, {"x"});
  const int y = find_property(element, {"y"});
  const int z = find_property(element, {"z"});
  const int r = find_property(element, {"red"});
  const int g = find_property(element, {"green"});
  const int b = find_property(element, {"blue"});
  if (x < 0 || y < 0 || z < 0) body.fail("PLY vertices need x, y and z");
  Values values;
  for (uint64_t i = 0; i < element.count; ++i) {
    read_element(body, element, values);
    const Eigen::Vector3f p(static_cast<float>(scalar(values, x)),
                            static_cast<float>(scalar(values, y)),
                            static_cast<float>(scalar(values, z)));
    if (!p.allFinite()) body.fail("vertex " + std::to_string(i) + " is not finite");
    mesh.vertices.push_back(p);
    if (r < 0 || g < 0 || b < 0) continue;
    const auto channel = [&](int property) {
      const double value = scalar(values, property);
      if (std::isnan(value)) {
        body.fail("the colour of vertex " + std::to_string(i) + " is not a number");
      }
      return static_cast<uint8_t>(std::clamp(value, 0.0, 255.0));
    };
    mesh.colours.push_back({channel(r), channel(g), channel(b)});
  }
}

void read_faces(Body& body, const Element& element, Mesh& mesh) {
  const int indices = find_property(element, {"vertex_indices", "vertex_index"});
  if (indices < 0) body.fail("PLY faces need vertex_indices");
  Values values;
  for (uint64_t i = 0; i < element.count; ++i) {
    read_element(body, element, values);
    const std::vector<double>& corners = values[static_cast<size_t>(indices)];
    for (const double corner : corners) {
      if (!(corner >= 0 && corner < static_cast<double>(mesh.vertices.size()))) {
        body.fail("face " + std::to_string(i) + " names a vertex that is not there");
      }
    }
    for (size_t c = 2; c < corners.size(); ++c) {
      mesh.triangles.push_back({static_cast<uint32_t>(corners[0]),
                                static_cast<uint32_t>(corners[c - 1]),
                                static_cast<uint32_t>(corners[c])});
    }
  }
}

}  // namespace

Mesh parse_ply(std::string_view bytes, const std::string& name) {
  const std::vector<Element> elements = parse_header(bytes, name);
  Body body(bytes, name);
  Mesh mesh;
  for (const Element& element : elements) {
    // The header may declare any number of elements of zero bytes.
    if (element.properties.empty() && element.count > 0)
      body.fail("PLY element without properties");
    if (element.name == "vertex") {
      read_vertices(body, element, mesh);
    } else if (element.name == "face") {
      read_faces(body, element, mesh);
    } else {
      Values ignored;
      for (uint64_t i = 0; i < element.count; ++i) read_element(body, element, ignored);
    }
  }
  return mesh;
}

Mesh read_ply(const std::filesystem::path& path) {
  return parse_ply(read_file(path), path.string());
}

namespace {

static_assert(std::endian::native == std::endian::little, "PLY is written as it lies in memory");

template <class T>
void put(std::string& bytes, const T& value) {
  bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
}

std::string ply_header(const Mesh& mesh, std::span<const PlyColours> more) {
  std::string header = "ply\nformat binary_little_endian 1.0\ncomment metres, z up\n";
  for (const PlyColours& colours : more) header += "comment " + colours.comment + "\n";
  header += "element vertex " + std::to_string(mesh.vertices.size()) +
            "\nproperty float x\nproperty float y\nproperty float z\n";
  if (!mesh.colours.empty()) {
    header += "property uchar red\nproperty uchar green\nproperty uchar blue\n";
  }
  for (const PlyColours& colours : more) {
    for (const std::string& name : colours.properties) header += "property uchar " + name + "\n";
  }
  return header + "element face " + std::to_string(mesh.triangles.size()) +
         "\nproperty list uchar int vertex_indices\nend_header\n";
}

}  // namespace

void write_ply(const std::filesystem::path& path, const Mesh& mesh,
               std::span<const PlyColours> more) {
  std::string bytes = ply_header(mesh, more);
  for (size_t i = 0; i < mesh.vertices.size(); ++i) {
    for (int axis = 0; axis < 3; ++axis) put(bytes, mesh.vertices[i][axis]);
    if (!mesh.colours.empty()) put(bytes, mesh.colours[i]);
    for (const PlyColours& colours : more) put(bytes, colours.vertices[i]);
  }
  for (const std::array<uint32_t, 3>& triangle : mesh.triangles) {
    put(bytes, uint8_t{3});
    for (const uint32_t vertex : triangle) put(bytes, static_cast<int32_t>(vertex));
  }
  replace_file(path, bytes);
}

Mesh read_obj(const std::filesystem::path& path) {
  tinyobj::ObjReaderConfig config;
  config.vertex_color = false;
  tinyobj::ObjReader reader;
  if (!reader.ParseFromString(read_file(path), "", config)) {
    throw InputError(path.string() + ": is no OBJ file: " + reader.Error());
  }
  Mesh mesh;
  const std::vector<tinyobj::real_t>& positions = reader.GetAttrib().vertices;
  for (size_t i = 0; i + 2 < positions.size(); i += 3) {
    mesh.vertices.emplace_back(positions[i], positions[i + 1], positions[i + 2]);
    if (!mesh.vertices.back().allFinite()) {
      throw InputError(path.string() + ": vertex " + std::to_string(i / 3 + 1) + " is not finite");
    }
  }
  for (const tinyobj::shape_t& shape : reader.GetShapes()) {
    const std::vector<tinyobj::index_t>& corners = shape.mesh.indices;
    for (size_t i = 0; i + 2 < corners.size(); i += 3) {
      std::array<uint32_t, 3> triangle;
      for (size_t k = 0; k < triangle.size(); ++k) {
        const int vertex = corners[i + k].vertex_index;
        if (vertex < 0 || static_cast<size_t>(vertex) >= mesh.vertices.size()) {
          throw InputError(path.string() + ": a face names vertex " + std::to_string(vertex + 1) +
                           " of " + std::to_string(mesh.vertices.size()));
        }
        triangle[k] = static_cast<uint32_t>(vertex);
      }
      mesh.triangles.push_back(triangle);
    }
  }
  if (mesh.triangles.empty()) throw InputError(path.string() + ": has no face");
  return mesh;
}

}  // namespace v3d
