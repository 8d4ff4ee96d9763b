#include "supple/core/io/gltf_file.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "io/scratch.h"
#include "supple/core/error.h"
#include "supple/core/io/atomic_file.h"

namespace supple::io {
namespace {

using Json = nlohmann::json;

// Numbers of the format.
constexpr int kFloat = 5126, kShort = 5123, kInt = 5125;
constexpr int kVertices = 34962, kIndices = 34963;

double to_linear(double c) { return c <= 0.04045 ? c / 12.92 : std::pow((c + 0.055) / 1.055, 2.4); }

/// An object in the frames that look alike.
struct Shown {
  std::size_t mesh = 0;
  std::size_t first = 0, last = 0;  ///< places in the list of frames
};

struct Track {
  Mesh before;
  std::optional<std::size_t> indices;  ///< accessor of the triangles of `before`
  std::vector<Shown> shown;
};

struct CameraTrack {
  std::string name;
  double field_of_view = 0.0, aspect = 1.0;
  std::vector<float> position, rotation;  ///< by frame
};

/// Rotation of a camera that looks along -z with y up.
Quat rotation_of(const UsdCamera& camera) {
  const Vec3 back = (camera.from - camera.look_at).normalized(), right = camera.up.cross(back).normalized();
  Mat3 axes;
  axes << right, back.cross(right), back;
  return Quat(axes).normalized();
}

}  // namespace

struct GltfAnimation::Impl {
  std::filesystem::path path;
  double frame_rate = 24.0;
  std::vector<UsdObject> objects;
  std::optional<Scratch> scratch;
  std::vector<Track> tracks;
  std::vector<CameraTrack> cameras;
  std::vector<int> frames;
  Json buffer_views = Json::array(), accessors = Json::array(), meshes = Json::array();

  /// @return the number of the accessor
  template <class T>
  std::size_t add_array(const std::vector<T>& values, std::size_t width, int kind, int target) {
    std::string bytes(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T));
    bytes.resize((bytes.size() + 3) / 4 * 4, '\0');
    expect_room(bytes.size());
    const Piece piece = scratch->append(bytes);
    Json view{{"buffer", 0}, {"byteOffset", piece.at}, {"byteLength", values.size() * sizeof(T)}};
    if (target != 0) view["target"] = target;
    buffer_views.push_back(std::move(view));
    constexpr std::array kTypes = {"SCALAR", "", "VEC3", "VEC4"};
    accessors.push_back({{"bufferView", buffer_views.size() - 1}, {"componentType", kind}, {"count", values.size() / width}, {"type", kTypes[width - 1]}});
    return accessors.size() - 1;
  }
  void expect_room(std::size_t bytes) const;
  std::size_t add_vectors(const std::vector<Vec3>& vectors, bool with_bounds);
  std::size_t add_triangles(const Mesh& mesh);
  std::size_t add_mesh(std::size_t object, const Mesh& mesh, Track& track);
  void add_times(std::size_t accessor, const std::vector<float>& times);
  Json materials() const;
  Json nodes_and_animation(Json& animation);
};

void GltfAnimation::Impl::expect_room(std::size_t bytes) const {
  constexpr std::size_t kLargest = std::numeric_limits<std::uint32_t>::max() / 16 * 15;  // the rest is for the description
  if (scratch->size() + bytes < kLargest) return;
  throw Error(ErrorKind::Limit, Fault{.place = path.string(),
                                      .key = {},
                                      .expected = "expected meshes of at most 4 GB in a glTF file",
                                      .found = "more in " + std::to_string(frames.size()) + " frames",
                                      .hint = "choose fewer frames or larger cells (output.cell)"});
}

std::size_t GltfAnimation::Impl::add_vectors(const std::vector<Vec3>& vectors, bool with_bounds) {
  std::vector<float> values;
  values.reserve(3 * vectors.size());
  for (const Vec3& v : vectors) {
    for (int k = 0; k < 3; ++k) values.push_back(static_cast<float>(v[k]));
  }
  const std::size_t at = add_array(values, 3, kFloat, kVertices);
  if (!with_bounds) return at;
  std::array<float, 3> low{values[0], values[1], values[2]}, high = low;
  for (std::size_t i = 0; i < values.size(); ++i) {
    low[i % 3] = std::min(low[i % 3], values[i]);
    high[i % 3] = std::max(high[i % 3], values[i]);
  }
  accessors[at]["min"] = low;
  accessors[at]["max"] = high;
  return at;
}

std::size_t GltfAnimation::Impl::add_triangles(const Mesh& mesh) {
  const auto corners = [&](auto narrow) {
    std::vector<decltype(narrow)> out;
    out.reserve(3 * mesh.triangle_count());
    for (const auto& triangle : mesh.triangle) {
      for (const std::uint32_t corner : triangle) out.push_back(static_cast<decltype(narrow)>(corner));
    }
    return out;
  };
  // The largest number of each kind is reserved.
  if (mesh.vertex_count() < std::numeric_limits<std::uint16_t>::max()) return add_array(corners(std::uint16_t{}), 1, kShort, kIndices);
  return add_array(corners(std::uint32_t{}), 1, kInt, kIndices);
}

std::size_t GltfAnimation::Impl::add_mesh(std::size_t object, const Mesh& mesh, Track& track) {
  if (!track.indices || track.before.triangle != mesh.triangle) track.indices = add_triangles(mesh);
  const std::size_t position = add_vectors(mesh.position, true), normal = add_vectors(mesh.normal, false);
  const Json part{{"attributes", {{"POSITION", position}, {"NORMAL", normal}}}, {"indices", *track.indices}, {"material", object}};
  meshes.push_back({{"name", objects[object].name}, {"primitives", Json::array({part})}});
  return meshes.size() - 1;
}

Json GltfAnimation::Impl::materials() const {
  Json out = Json::array();
  for (const UsdObject& object : objects) {
    const Vec3 c = object.colour.unaryExpr(&to_linear);
    out.push_back({{"name", object.name},
                   {"pbrMetallicRoughness",
                    {{"baseColorFactor", {c.x(), c.y(), c.z(), 1.0}}, {"metallicFactor", 0.0}, {"roughnessFactor", object.roughness}}}});
  }
  return out;
}

void GltfAnimation::Impl::add_times(std::size_t accessor, const std::vector<float>& times) {
  accessors[accessor]["min"] = Json::array({times.front()});
  accessors[accessor]["max"] = Json::array({times.back()});
}

/// Nodes of all frames; node 0 is the root.
Json GltfAnimation::Impl::nodes_and_animation(Json& animation) {
  Json nodes = Json::array(), children = Json::array();
  nodes.push_back({{"name", path.stem().string()}, {"rotation", {-std::sqrt(0.5), 0.0, 0.0, std::sqrt(0.5)}}});
  animation = {{"name", path.stem().string()}, {"channels", Json::array()}, {"samplers", Json::array()}};
  const auto add_channel = [&](std::size_t node, const char* what, const char* between, const std::vector<float>& times, const std::vector<float>& values,
                               std::size_t width) {
    const std::size_t input = add_array(times, 1, kFloat, 0), output = add_array(values, width, kFloat, 0);
    add_times(input, times);
    animation["samplers"].push_back({{"input", input}, {"output", output}, {"interpolation", between}});
    animation["channels"].push_back({{"sampler", animation["samplers"].size() - 1}, {"target", {{"node", node}, {"path", what}}}});
  };
  const auto time_of = [&](std::size_t place) {
    const double frame = place < frames.size() ? frames[place] : frames.back() + 1;
    return static_cast<float>((frame - frames.front()) / frame_rate);
  };
  for (std::size_t i = 0; i < tracks.size(); ++i) {
    for (const Shown& shown : tracks[i].shown) {
      const bool at_start = shown.first == 0, at_end = shown.last + 1 == frames.size();
      Json node{{"name", objects[i].name + '.' + std::to_string(frames[shown.first])}, {"mesh", shown.mesh}};
      if (!at_start) node["scale"] = {0.0, 0.0, 0.0};
      nodes.push_back(std::move(node));
      children.push_back(nodes.size() - 1);
      if (at_start && at_end) continue;
      std::vector<float> times, values;
      const auto key = [&](float time, float scale) {
        times.push_back(time);
        values.insert(values.end(), 3, scale);
      };
      if (!at_start) key(0.0F, 0.0F);
      key(time_of(shown.first), 1.0F);
      key(time_of(shown.last + 1), at_end ? 1.0F : 0.0F);
      add_channel(nodes.size() - 1, "scale", "STEP", times, values, 3);
    }
  }
  std::vector<float> times;
  for (std::size_t k = 0; k < frames.size(); ++k) times.push_back(time_of(k));
  for (std::size_t k = 0; k < cameras.size(); ++k) {
    const CameraTrack& c = cameras[k];
    nodes.push_back({{"name", c.name}, {"camera", k}, {"translation", {c.position[0], c.position[1], c.position[2]}},
                     {"rotation", {c.rotation[0], c.rotation[1], c.rotation[2], c.rotation[3]}}});
    children.push_back(nodes.size() - 1);
    const bool stays = std::equal(c.position.begin() + 3, c.position.end(), c.position.begin()) &&
                       std::equal(c.rotation.begin() + 4, c.rotation.end(), c.rotation.begin());
    if (stays) continue;
    add_channel(nodes.size() - 1, "translation", "LINEAR", times, c.position, 3);
    add_channel(nodes.size() - 1, "rotation", "LINEAR", times, c.rotation, 4);
  }
  nodes[0]["children"] = std::move(children);
  return nodes;
}

GltfAnimation::GltfAnimation(std::filesystem::path path, double frame_rate, std::span<const UsdObject> objects) : impl_(std::make_unique<Impl>()) {
  SUPPLE_EXPECTS(frame_rate > 0.0);
  impl_->path = std::move(path);
  impl_->scratch.emplace(impl_->path);
  impl_->frame_rate = frame_rate;
  impl_->objects.assign(objects.begin(), objects.end());
  impl_->tracks.resize(objects.size());
}

GltfAnimation::~GltfAnimation() = default;

void GltfAnimation::add_frame(int frame, std::span<const Mesh* const> meshes, std::span<const UsdCamera> cameras) {
  SUPPLE_EXPECTS(meshes.size() == impl_->tracks.size());
  SUPPLE_EXPECTS(impl_->frames.empty() || frame > impl_->frames.back());
  const std::size_t place = impl_->frames.size();
  impl_->frames.push_back(frame);
  for (std::size_t i = 0; i < meshes.size(); ++i) {
    const Mesh& mesh = *meshes[i];
    SUPPLE_EXPECTS(mesh.normal.size() == mesh.vertex_count());
    if (mesh.triangle.empty()) continue;
    Track& track = impl_->tracks[i];
    const bool stays = !track.shown.empty() && track.shown.back().last + 1 == place && track.before.position == mesh.position && track.before.triangle == mesh.triangle;
    if (stays) {
      track.shown.back().last = place;
      continue;
    }
    track.shown.push_back({impl_->add_mesh(i, mesh, track), place, place});
    track.before = {.position = mesh.position, .normal = {}, .triangle = mesh.triangle, .columns = {}};
  }
  if (place == 0) {
    for (const UsdCamera& c : cameras) impl_->cameras.push_back({c.name, c.field_of_view, c.aspect, {}, {}});
  }
  SUPPLE_EXPECTS(cameras.size() == impl_->cameras.size());
  for (std::size_t k = 0; k < cameras.size(); ++k) {
    CameraTrack& track = impl_->cameras[k];
    const Quat q = rotation_of(cameras[k]);
    for (int i = 0; i < 3; ++i) track.position.push_back(static_cast<float>(cameras[k].from[i]));
    for (const double part : {q.x(), q.y(), q.z(), q.w()}) track.rotation.push_back(static_cast<float>(part));
  }
}

void GltfAnimation::finish() {
  Impl& all = *impl_;
  SUPPLE_EXPECTS(!all.frames.empty());
  Json animation;
  Json nodes = all.nodes_and_animation(animation);
  const Json timing{{"frame_rate", all.frame_rate}, {"first_frame", all.frames.front()}, {"last_frame", all.frames.back()}};
  Json json{{"asset", {{"version", "2.0"}, {"generator", "supple"}, {"extras", timing}}}, {"scene", 0}, {"scenes", Json::array({Json{{"nodes", Json::array({0})}}})}};
  json["nodes"] = std::move(nodes);
  json["materials"] = all.materials();
  if (!animation["channels"].empty()) json["animations"] = Json::array({std::move(animation)});
  for (const auto& [name, list] : {std::pair{"meshes", &all.meshes}, {"accessors", &all.accessors}, {"bufferViews", &all.buffer_views}}) {
    if (!list->empty()) json[name] = *list;
  }
  if (all.scratch->size() > 0) json["buffers"] = Json::array({Json{{"byteLength", all.scratch->size()}}});
  for (const CameraTrack& c : all.cameras) {
    json["cameras"].push_back({{"name", c.name}, {"type", "perspective"},
                               {"perspective", {{"yfov", c.field_of_view}, {"aspectRatio", c.aspect}, {"znear", 0.01}}}});
  }
  std::string text = json.dump();
  text.resize((text.size() + 3) / 4 * 4, ' ');
  const std::size_t bytes = all.scratch->size();
  const auto word = [](std::size_t value) {
    std::string out;
    for (unsigned k = 0; k < 4; ++k) out += static_cast<char>((value >> (8U * k)) & 0xFFU);
    return out;
  };
  const bool holds = bytes > 0;
  AtomicFile file(all.path);
  file.append("glTF" + word(2) + word(12 + 8 + text.size() + (holds ? 8 + bytes : 0)));
  file.append(word(text.size()) + "JSON" + text);
  if (holds) {
    file.append(word(bytes) + std::string("BIN\0", 4));
    all.scratch->copy_to(file, {0, bytes});
  }
  file.commit();
}

}  // namespace supple::io
