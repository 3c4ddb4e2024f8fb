#include "solver/gltf/layout.h"

#include <array>

#include "solver/gltf/accessor.h"
#include "solver/gltf/nodes.h"
#include "solver/gltf/references.h"

namespace radbake::gltf {

std::size_t SizeOf(Component component) {
  switch (component) {
    case Component::kInt8:
    case Component::kUint8:
      return 1;
    case Component::kInt16:
    case Component::kUint16:
      return 2;
    case Component::kUint32:
    case Component::kFloat:
      break;
  }
  return 4;
}

std::optional<std::size_t> Primitive::Find(std::string_view name) const {
  for (const auto& [attribute, accessor] : attributes) {
    if (attribute == name) {
      return accessor;
    }
  }
  return std::nullopt;
}

std::size_t Primitive::Corners(const std::vector<Accessor>& accessors) const {
  if (indices) {
    return accessors[*indices].count;
  }
  return attributes.empty() ? 0 : accessors[attributes.front().second].count;
}

std::size_t Primitive::Triangles(const std::vector<Accessor>& accessors) const {
  const std::size_t corners = Corners(accessors);
  switch (mode) {
    case Mode::kTriangles:
      return corners / 3;
    case Mode::kStrip:
    case Mode::kFan:
      return corners < 3 ? 0 : corners - 2;
    default:
      return 0;
  }
}

namespace {

View CheckView(const Json& view, const std::vector<std::string_view>& buffers, const Place& place) {
  View checked;
  const std::optional<std::size_t> buffer = FindIndex(view, "buffer", buffers.size(), place);
  if (!buffer) {
    Fail(place, "buffer is missing");
  }
  checked.buffer = *buffer;
  checked.offset = FindCount(view, "byteOffset", place).value_or(0);
  checked.length = Count(view, "byteLength", place);
  checked.stride = FindCount(view, "byteStride", place).value_or(0);
  const std::size_t size = buffers[checked.buffer].size();
  if (checked.offset > size || checked.length > size - checked.offset) {
    Fail(place,
         "reaches beyond the " + std::to_string(size) + " bytes of buffer " + std::to_string(checked.buffer));
  }
  return checked;
}

Component CheckComponent(const Json& object, const Place& place) {
  const std::size_t component = Count(object, "componentType", place);
  if (component < 5120 || component > 5126 || component == 5124) {
    Fail(place, "componentType " + std::to_string(component) + " is not known");
  }
  return static_cast<Component>(component);
}

/// The bytes that `count` elements take from `offset` on, checked without overflow.
std::string_view Range(const View& view, std::string_view buffer, std::size_t offset, std::size_t count,
                       std::size_t stride, std::size_t element, const Place& place) {
  if (offset > view.length || element > view.length - offset ||
      (count - 1) > (view.length - offset - element) / stride) {
    Fail(place, std::to_string(count) + " elements reach beyond the " + std::to_string(view.length) +
                    " bytes of their buffer view");
  }
  return buffer.substr(view.offset + offset, (count - 1) * stride + element);
}

class AccessorChecker {
 public:
  AccessorChecker(const std::vector<View>& views, const std::vector<std::string_view>& buffers,
                  const Limits& limits)
      : views_(views), buffers_(buffers), most_elements_(3 * limits.triangles) {}

  Accessor Check(const Json& json, const Place& place) {
    Accessor accessor;
    accessor.component = CheckComponent(json, place);
    CheckType(json, accessor, place);
    accessor.normalized = Flag(json, "normalized", false, place);
    accessor.count = Count(json, "count", place);
    if (accessor.count == 0) {
      Fail(place, "has no elements");
    }
    const std::size_t element = accessor.columns * accessor.column_stride;
    accessor.stride = element;
    if (const std::optional<std::size_t> view = FindIndex(json, "bufferView", views_.size(), place)) {
      if (views_[*view].stride != 0) {
        accessor.stride = views_[*view].stride;
      }
      if (accessor.stride < element) {
        Fail(place, "its elements are longer than the byteStride of buffer view " + std::to_string(*view));
      }
      accessor.bytes = Range(views_[*view], buffers_[views_[*view].buffer],
                             FindCount(json, "byteOffset", place).value_or(0), accessor.count,
                             accessor.stride, element, place);
    } else if (accessor.count > most_elements_) {
      Fail(place, std::to_string(accessor.count) + " elements are more than the limit of " +
                      std::to_string(most_elements_));
    }
    if (const Json* sparse = FindObject(json, "sparse", place)) {
      accessor.sparse = CheckSparse(*sparse, accessor, element, place);
    }
    return accessor;
  }

 private:
  static void CheckType(const Json& json, Accessor& accessor, const Place& place) {
    struct Type {
      std::string_view name;
      std::size_t rows, columns;
    };
    constexpr std::array<Type, 7> kTypes = {{{"SCALAR", 1, 1},
                                             {"VEC2", 2, 1},
                                             {"VEC3", 3, 1},
                                             {"VEC4", 4, 1},
                                             {"MAT2", 2, 2},
                                             {"MAT3", 3, 3},
                                             {"MAT4", 4, 4}}};
    const std::string name = Text(json, "type", "", place);
    for (const Type& type : kTypes) {
      if (type.name == name) {
        accessor.rows = type.rows;
        accessor.columns = type.columns;
        const std::size_t column = type.rows * SizeOf(accessor.component);
        accessor.column_stride = type.columns == 1 ? column : (column + 3) / 4 * 4;
        return;
      }
    }
    Fail(place, "type " + Quoted(name) + " is not known");
  }

  Sparse CheckSparse(const Json& json, const Accessor& accessor, std::size_t element, const Place& place) {
    const Json* indices = FindObject(json, "indices", place);
    const Json* values = FindObject(json, "values", place);
    if (indices == nullptr || values == nullptr) {
      Fail(place, "sparse has no indices or no values");
    }
    Sparse sparse;
    sparse.count = Count(json, "count", place);
    // Sparse parts are read here in whole: together they may not be more than a scene's vertices.
    if (sparse.count == 0 || sparse.count > accessor.count ||
        sparse.count > most_elements_ - sparse_elements_) {
      Fail(place, "sparse count " + std::to_string(sparse.count) + " is out of range");
    }
    sparse_elements_ += sparse.count;
    sparse.index_component = CheckComponent(*indices, place);
    if (sparse.index_component != Component::kUint8 && sparse.index_component != Component::kUint16 &&
        sparse.index_component != Component::kUint32) {
      Fail(place, "sparse indices are not unsigned");
    }
    sparse.indices = Packed(*indices, sparse.count, SizeOf(sparse.index_component), place);
    sparse.values = Packed(*values, sparse.count, element, place);
    for (std::size_t i = 0; i < sparse.count; ++i) {
      const std::size_t index = ReadSparseIndex(sparse, i);
      if (index >= accessor.count || (i > 0 && index <= ReadSparseIndex(sparse, i - 1))) {
        Fail(place, "sparse index " + std::to_string(index) + " is out of range or out of order");
      }
    }
    return sparse;
  }

  std::string_view Packed(const Json& json, std::size_t count, std::size_t element, const Place& place) {
    const std::optional<std::size_t> view = FindIndex(json, "bufferView", views_.size(), place);
    if (!view) {
      Fail(place, "sparse bufferView is missing");
    }
    return Range(views_[*view], buffers_[views_[*view].buffer],
                 FindCount(json, "byteOffset", place).value_or(0), count, element, element, place);
  }

  const std::vector<View>& views_;
  const std::vector<std::string_view>& buffers_;
  std::size_t most_elements_;
  std::size_t sparse_elements_ = 0;
};

/// Semantics of the core format come as one type each; what others mean is their own affair.
void CheckAttribute(const std::string& name, const Accessor& accessor, std::size_t vertices,
                    const Place& place) {
  const auto expect = [&](bool fits) {
    if (!fits) {
      Fail(place, "attribute " + Quoted(name) + " has a type that its meaning does not allow");
    }
  };
  const bool vector = accessor.columns == 1;
  if (name == "POSITION" || name == "NORMAL") {
    expect(vector && accessor.rows == 3);
  } else if (name == "TANGENT") {
    expect(vector && accessor.rows == 4);
  } else if (name.starts_with("TEXCOORD_")) {
    expect(vector && accessor.rows == 2);
  } else if (name.starts_with("COLOR_")) {
    expect(vector && (accessor.rows == 3 || accessor.rows == 4));
  }
  if (accessor.count != vertices) {
    Fail(place, "attribute " + Quoted(name) + " has " + std::to_string(accessor.count) +
                    " elements, and others " + std::to_string(vertices));
  }
}

Primitive CheckPrimitive(const Json& json, const std::vector<Accessor>& accessors, std::size_t materials,
                         const Place& place) {
  constexpr std::size_t kMostAttributes = 64;
  Primitive primitive;
  const std::size_t mode = FindCount(json, "mode", place).value_or(4);
  if (mode > 6) {
    Fail(place, "mode " + std::to_string(mode) + " is not known");
  }
  primitive.mode = static_cast<Mode>(mode);
  primitive.material = FindIndex(json, "material", materials, place);
  const Json* attributes = FindObject(json, "attributes", place);
  if (attributes == nullptr) {
    Fail(place, "attributes are missing");
  }
  if (attributes->size() > kMostAttributes) {
    Fail(place, "has more than " + std::to_string(kMostAttributes) + " attributes");
  }
  for (const auto& attribute : attributes->items()) {
    const std::size_t accessor = Count(*attributes, attribute.key().c_str(), place);
    const std::size_t vertices =
        accessors[primitive.attributes.empty() ? accessor : primitive.attributes.front().second].count;
    CheckAttribute(attribute.key(), accessors[accessor], vertices, place);
    primitive.attributes.emplace_back(attribute.key(), accessor);
  }
  primitive.indices = FindIndex(json, "indices", accessors.size(), place);
  if (primitive.indices) {
    const Accessor& indices = accessors[*primitive.indices];
    if (indices.Width() != 1 ||
        (indices.component != Component::kUint8 && indices.component != Component::kUint16 &&
         indices.component != Component::kUint32)) {
      Fail(place, "indices are not unsigned scalars");
    }
  }
  return primitive;
}

}  // namespace

Layout CheckLayout(const Json& root, const std::vector<std::string_view>& buffers, const Limits& limits) {
  const Place whole{"glTF"};
  Layout layout;
  const Json& views = Objects(root, "bufferViews", whole);
  for (std::size_t i = 0; i < views.size(); ++i) {
    layout.views.push_back(CheckView(views[i], buffers, {"bufferView", i}));
  }
  AccessorChecker checker(layout.views, buffers, limits);
  const Json& accessors = Objects(root, "accessors", whole);
  for (std::size_t i = 0; i < accessors.size(); ++i) {
    layout.accessors.push_back(checker.Check(accessors[i], {"accessor", i}));
  }
  CheckReferences(root, layout.accessors.size(), layout.views.size());

  const std::size_t materials = Objects(root, "materials", whole).size();
  const Json& meshes = Objects(root, "meshes", whole);
  for (std::size_t m = 0; m < meshes.size(); ++m) {
    const Json& primitives = Objects(meshes[m], "primitives", {"mesh", m});
    Mesh& mesh = layout.meshes.emplace_back();
    for (std::size_t p = 0; p < primitives.size(); ++p) {
      const Place place{"mesh", m, "primitive", p};
      mesh.primitives.push_back(CheckPrimitive(primitives[p], layout.accessors, materials, place));
      mesh.morphs = mesh.morphs || Find(primitives[p], "targets") != nullptr;
    }
  }
  CheckNodes(root, limits, layout);
  return layout;
}

}  // namespace radbake::gltf
