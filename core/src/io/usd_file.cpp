#include "supple/core/io/usd_file.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <map>
#include <numbers>
#include <optional>
#include <set>
#include <vector>

#include "io/number_text.h"
#include "io/scratch.h"
#include "supple/core/error.h"
#include "supple/core/io/atomic_file.h"

namespace supple::io {
namespace {

constexpr std::string_view kIndent = "            ";

/// The time samples of one attribute. A value that stays is kept by its first and its last frame.
class Track {
 public:
  explicit Track(Scratch& scratch) : scratch_(scratch) {}

  void add(int frame, std::string value) {
    if (last_ && value == *last_) {
      repeated_ = frame;
      return;
    }
    if (repeated_) write(*repeated_, *last_);
    repeated_.reset();
    write(frame, value);
    last_ = std::move(value);
  }
  void copy_to(AtomicFile& out, std::string_view attribute) {
    out.append("        ");
    out.append(attribute);
    out.append(".timeSamples = {\n");
    for (const Piece& piece : pieces_) scratch_.copy_to(out, piece);
    out.append("        }\n");
  }

 private:
  void write(int frame, std::string_view value) {
    std::string line(kIndent);
    line += std::to_string(frame) + ": ";
    line += value;
    line += ",\n";
    pieces_.push_back(scratch_.append(line));
  }

  Scratch& scratch_;
  std::vector<Piece> pieces_;
  std::optional<std::string> last_;
  std::optional<int> repeated_;
};

template <class Items, class Append>
std::string listed(const Items& items, const Append& append) {
  std::string text = "[";
  bool first = true;
  for (const auto& item : items) {
    if (!first) text += ", ";
    first = false;
    append(text, item);
  }
  return text + ']';
}

void append_tuple(std::string& text, const Vec3& v) {
  text += '(';
  append_vector(text, v, ", ");
  text += ')';
}

std::string tuple(const Vec3& v) {
  std::string text;
  append_tuple(text, v);
  return text;
}

std::string number(double value) {
  std::string text;
  append_number(text, static_cast<float>(value));
  return text;
}

std::string identifier(std::string_view name) {
  std::string out;
  for (const char c : name) {
    const bool letter = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_';
    const bool digit = c >= '0' && c <= '9';
    if (digit && out.empty()) out += '_';
    out += letter || digit ? c : '_';
  }
  return out.empty() ? "_" : out;
}

/// Displayed colours are linear in USD.
double to_linear(double c) { return c <= 0.04045 ? c / 12.92 : std::pow((c + 0.055) / 1.055, 2.4); }

const Mesh::Column* find_column(const Mesh& mesh, std::string_view name) {
  const auto at = std::find_if(mesh.columns.begin(), mesh.columns.end(), [&](const auto& c) { return c.name == name; });
  return at == mesh.columns.end() ? nullptr : &*at;
}

constexpr std::array<std::string_view, 3> kVelocity = {"velocity_x", "velocity_y", "velocity_z"};

/// One object over all frames.
class Tracks {
 public:
  explicit Tracks(Scratch& scratch)
      : scratch_(scratch), points_(scratch), normals_(scratch), extent_(scratch), counts_(scratch), indices_(scratch),
        visibility_(scratch) {}

  void add(int frame, const Mesh& mesh) {
    SUPPLE_EXPECTS(mesh.normal.size() == mesh.vertex_count());
    visibility_.add(frame, mesh.position.empty() ? "\"invisible\"" : "\"inherited\"");
    points_.add(frame, listed(mesh.position, append_tuple));
    normals_.add(frame, listed(mesh.normal, append_tuple));
    Vec3 low = Vec3::Zero(), high = Vec3::Zero();
    if (!mesh.position.empty()) low = high = mesh.position.front();
    for (const Vec3& p : mesh.position) {
      low = low.cwiseMin(p);
      high = high.cwiseMax(p);
    }
    extent_.add(frame, listed(std::array{low, high}, append_tuple));
    counts_.add(frame, listed(mesh.triangle, [](std::string& text, const auto&) { text += '3'; }));
    indices_.add(frame, listed(mesh.triangle, [](std::string& text, const auto& t) {
                   text.append(std::to_string(t[0])).append(", ").append(std::to_string(t[1])).append(", ");
                   text.append(std::to_string(t[2]));
                 }));
    add_velocities(frame, mesh);
    add_columns(frame, mesh);
    seen_.push_back({frame, mesh.vertex_count()});
  }

  void copy_to(AtomicFile& out) {
    visibility_.copy_to(out, "token visibility");
    extent_.copy_to(out, "float3[] extent");
    counts_.copy_to(out, "int[] faceVertexCounts");
    indices_.copy_to(out, "int[] faceVertexIndices");
    points_.copy_to(out, "point3f[] points");
    out.append("        normal3f[] normals (\n            interpolation = \"vertex\"\n        )\n");
    normals_.copy_to(out, "normal3f[] normals");
    if (velocities_) velocities_->copy_to(out, "vector3f[] velocities");
    for (auto& [name, track] : columns_) {
      const std::string attribute = "float[] primvars:" + identifier(name);
      out.append("        " + attribute + " (\n            interpolation = \"vertex\"\n        )\n");
      track.copy_to(out, attribute);
    }
  }

 private:
  /// A column that a frame does not have is zero there, so that it has one value per vertex in all frames.
  void add_columns(int frame, const Mesh& mesh) {
    for (const Mesh::Column& column : mesh.columns) {
      if (std::find(kVelocity.begin(), kVelocity.end(), column.name) != kVelocity.end()) continue;
      const auto [at, fresh] = columns_.try_emplace(column.name, scratch_);
      if (!fresh) continue;
      for (const Seen& earlier : seen_) at->second.add(earlier.frame, zeros(earlier.vertices));
    }
    for (auto& [name, track] : columns_) {
      const Mesh::Column* column = find_column(mesh, name);
      track.add(frame, column == nullptr ? zeros(mesh.vertex_count()) : listed(column->values, append_single));
    }
  }
  static void append_single(std::string& text, double value) { append_number(text, static_cast<float>(value)); }
  static std::string zeros(std::size_t count) { return listed(std::vector<double>(count), append_single); }

  void add_velocities(int frame, const Mesh& mesh) {
    std::array<const Mesh::Column*, 3> v{};
    for (std::size_t k = 0; k < 3; ++k) v[k] = find_column(mesh, kVelocity[k]);
    if (v[0] == nullptr || v[1] == nullptr || v[2] == nullptr) return;
    if (!velocities_) velocities_.emplace(scratch_);
    std::vector<Vec3> velocity(mesh.vertex_count());
    for (std::size_t i = 0; i < velocity.size(); ++i) velocity[i] = Vec3(v[0]->values[i], v[1]->values[i], v[2]->values[i]);
    velocities_->add(frame, listed(velocity, append_tuple));
  }

  struct Seen {
    int frame;
    std::size_t vertices;
  };

  Scratch& scratch_;
  std::vector<Seen> seen_;
  Track points_, normals_, extent_, counts_, indices_, visibility_;
  std::optional<Track> velocities_;
  std::map<std::string, Track> columns_;
};

std::string material_text(const std::string& name, const UsdObject& object) {
  const Vec3 colour = object.colour.unaryExpr(&to_linear);
  const std::string path = "</scene/materials/" + name;
  return "        def Material \"" + name + "\"\n        {\n            token outputs:surface.connect = " + path +
         "/surface.outputs:surface>\n\n            def Shader \"surface\"\n            {\n"
         "                uniform token info:id = \"UsdPreviewSurface\"\n                color3f inputs:diffuseColor = " +
         tuple(colour) + "\n                float inputs:roughness = " + number(object.roughness) +
         "\n                token outputs:surface\n            }\n        }\n";
}

/// One camera over all frames.
class CameraTracks {
 public:
  CameraTracks(Scratch& scratch, std::string name, double aspect)
      : name_(std::move(name)), aspect_(aspect), transform_(scratch), focal_length_(scratch) {}

  void add(int frame, const UsdCamera& camera) {
    const Vec3 back = (camera.from - camera.look_at).normalized();
    const Vec3 right = camera.up.cross(back).normalized();
    const auto row = [](const Vec3& v, double w) {
      std::string text = "(";
      for (int k = 0; k < 3; ++k) {
        append_number(text, v[k]);
        text += ", ";
      }
      return text + number(w) + ')';
    };
    transform_.add(frame, "( " + row(right, 0) + ", " + row(back.cross(right), 0) + ", " + row(back, 0) + ", " +
                              row(camera.from, 1) + " )");
    focal_length_.add(frame, number(0.5 * kFilmHeight / std::tan(0.5 * camera.field_of_view)));
  }
  void copy_to(AtomicFile& out) {
    out.append("    def Camera \"" + name_ + "\"\n    {\n        uniform token[] xformOpOrder = [\"xformOp:transform\"]\n" +
               "        float verticalAperture = " + number(kFilmHeight) + "\n        float horizontalAperture = " +
               number(kFilmHeight * aspect_) + "\n        float2 clippingRange = (0.01, 100000)\n");
    transform_.copy_to(out, "matrix4d xformOp:transform");
    focal_length_.copy_to(out, "float focalLength");
    out.append("    }\n\n");
  }

 private:
  static constexpr double kFilmHeight = 24.0;  // [tenths of a scene unit, as USD has it]
  std::string name_;
  double aspect_;
  Track transform_, focal_length_;
};

}  // namespace

struct UsdAnimation::Impl {
  std::filesystem::path path;
  double frame_rate = 24.0;
  std::vector<UsdObject> objects;
  std::vector<std::string> names;          // unique USD names
  std::optional<Scratch> scratch;
  std::vector<std::unique_ptr<Tracks>> tracks;
  std::vector<std::unique_ptr<CameraTracks>> cameras;
  std::set<std::string> taken = {"materials"};
  std::optional<int> first, last;

  std::string unique_name(std::string_view name) {
    std::string out = identifier(name);
    while (!taken.insert(out).second) out += '_';
    return out;
  }
};

UsdAnimation::UsdAnimation(std::filesystem::path path, double frame_rate, std::span<const UsdObject> objects)
    : impl_(std::make_unique<Impl>()) {
  SUPPLE_EXPECTS(frame_rate > 0.0);
  impl_->path = std::move(path);
  impl_->scratch.emplace(impl_->path);
  impl_->frame_rate = frame_rate;
  impl_->objects.assign(objects.begin(), objects.end());
  for (const UsdObject& object : objects) {
    impl_->names.push_back(impl_->unique_name(object.name));
    impl_->tracks.push_back(std::make_unique<Tracks>(*impl_->scratch));
  }
}

UsdAnimation::~UsdAnimation() = default;

void UsdAnimation::add_frame(int frame, std::span<const Mesh* const> meshes, std::span<const UsdCamera> cameras) {
  SUPPLE_EXPECTS(meshes.size() == impl_->tracks.size());
  SUPPLE_EXPECTS(!impl_->last || frame > *impl_->last);
  if (!impl_->first) impl_->first = frame;
  impl_->last = frame;
  for (std::size_t i = 0; i < meshes.size(); ++i) impl_->tracks[i]->add(frame, *meshes[i]);
  for (std::size_t i = impl_->cameras.size(); i < cameras.size(); ++i) {
    impl_->cameras.push_back(
        std::make_unique<CameraTracks>(*impl_->scratch, impl_->unique_name(cameras[i].name), cameras[i].aspect));
  }
  SUPPLE_EXPECTS(cameras.size() == impl_->cameras.size());
  for (std::size_t i = 0; i < cameras.size(); ++i) impl_->cameras[i]->add(frame, cameras[i]);
}

void UsdAnimation::finish() {
  std::string rate;
  append_number(rate, impl_->frame_rate);
  AtomicFile out(impl_->path);
  out.append("#usda 1.0\n(\n    defaultPrim = \"scene\"\n    endTimeCode = " + std::to_string(impl_->last.value_or(1)) +
             "\n    framesPerSecond = " + rate + "\n    metersPerUnit = 1\n    startTimeCode = " +
             std::to_string(impl_->first.value_or(1)) + "\n    timeCodesPerSecond = " + rate +
             "\n    upAxis = \"Z\"\n)\n\ndef Xform \"scene\"\n{\n");
  for (const auto& camera : impl_->cameras) camera->copy_to(out);
  out.append("    def Scope \"materials\"\n    {\n");
  for (std::size_t i = 0; i < impl_->objects.size(); ++i) out.append(material_text(impl_->names[i], impl_->objects[i]));
  out.append("    }\n");
  for (std::size_t i = 0; i < impl_->objects.size(); ++i) {
    const std::string& name = impl_->names[i];
    out.append("\n    def Mesh \"");
    out.append(name);
    out.append("\" (\n        prepend apiSchemas = [\"MaterialBindingAPI\"]\n    )\n    {\n"
               "        uniform token subdivisionScheme = \"none\"\n        rel material:binding = </scene/materials/");
    out.append(name);
    out.append(">\n        color3f[] primvars:displayColor = [");
    out.append(tuple(impl_->objects[i].colour.unaryExpr(&to_linear)));
    out.append("]\n");
    impl_->tracks[i]->copy_to(out);
    out.append("    }\n");
  }
  out.append("}\n");
  out.commit();
}

}  // namespace supple::io
