#include <array>
#include <cmath>
#include <cstdarg>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <numbers>

#include "supple/core/counted.h"
#include "supple/core/printable.h"
#include "supple/fit/fit.h"

namespace supple::fit {
namespace {

[[gnu::format(printf, 2, 3)]] void put(std::string& out, const char* format, ...) {
  std::array<char, 512> text{};
  std::va_list values;
  va_start(values, format);
  std::vsnprintf(text.data(), text.size(), format, values);
  va_end(values);
  out += text.data();
}

std::string point_text(const Vec3& p) {
  std::string out;
  put(out, "[%.7g, %.7g, %.7g]", p.x(), p.y(), p.z());
  return out;
}

void put_primitive(std::string& out, const FittedPrimitive& p) {
  const bool round = !p.segment && p.semi_axes.x() == p.semi_axes.y() && p.semi_axes.x() == p.semi_axes.z();
  if (round) {
    put(out, "  - {shape: point, at: %s, kernel: {radius: %.7g}, particles: [%u]}\n", point_text(p.at).c_str(), p.semi_axes.x(), p.particle);
    return;
  }
  const Eigen::AngleAxisd turn(Eigen::Quaterniond(p.orientation.coeffs()));
  if (p.segment) {
    put(out, "  - {shape: segment, half_length: %.7g, ", p.semi_axes.x());
  } else {
    put(out, "  - {shape: ellipsoid, semi_axes: %s, ", point_text(p.semi_axes).c_str());
  }
  put(out, "at: %s, turn_axis: %s, turn_deg: %.7g, kernel: ", point_text(p.at).c_str(), point_text(turn.axis()).c_str(), turn.angle() * 180.0 / std::numbers::pi);
  if (p.segment) {
    put(out, "{radius: %.7g}, particles: [%u]}\n", p.semi_axes.y(), p.particle);
  } else {
    put(out, "{type: wyvill}, particles: [%u]}\n", p.particle);
  }
}

}  // namespace

std::string object_text(const FittedObject& object, const std::string& title) {
  const FitReport& r = object.report;
  std::string out;
  out += "# " + printable(title) + '\n';
  put(out, "# %s on %s; distance to the data: RMS %.2g %%, largest %.2g %% of the diagonal.\n", counted(r.primitives, "primitive").c_str(), counted(r.particles, "particle").c_str(), 100.0 * std::max(r.from_data.rms, r.to_data.rms),
      100.0 * r.two_sided());
  out += "# A scene uses it by `include` in an item of `objects`, where other keys replace these.\n";
  out += "# The origin is the centre of mass, in the data " + point_text(object.origin) + ".\n";
  const Substance& m = object.material;
  put(out, "material: {youngs_modulus: %.7g, density: %.7g, poissons_ratio: %.7g, damping_ratio: %.7g, friction: %.7g}\ncontact: true\n", m.youngs_modulus, m.density, m.poissons_ratio, m.damping_ratio, m.friction);
  out += "particles:\n  arrange: points\n  points:\n";
  for (const Vec3& p : object.particles) out += "  - " + point_text(p) + '\n';
  if (!object.bonds.empty()) {
    out += "  bonds: [";
    for (std::size_t k = 0; k < object.bonds.size(); ++k) {
      constexpr std::size_t kOfLine = 16;
      put(out, "%s%u, %u", k == 0 ? "" : k % kOfLine == 0 ? ",\n    " : ", ", object.bonds[k][0], object.bonds[k][1]);
    }
    out += "]\n  sections: [";
    for (std::size_t k = 0; k < object.sections.size(); ++k) {
      constexpr std::size_t kOfLine = 16;
      put(out, "%s%.4g", k == 0 ? "" : k % kOfLine == 0 ? ",\n    " : ", ", object.sections[k]);
    }
    out += "]\n";
  }
  if (!object.frames.empty()) {
    put(out, "  thickness: %.7g\n  normals:\n", object.thickness);
    for (const FittedFrame& f : object.frames) out += "  - " + point_text(f.normal) + '\n';
    out += "  directions:\n";
    for (const FittedFrame& f : object.frames) out += "  - " + point_text(f.direction) + '\n';
    out += "  curvatures: [";
    for (std::size_t k = 0; k < object.frames.size(); ++k) put(out, "%s%.6g, %.6g", k == 0 ? "" : ", ", object.frames[k].first, object.frames[k].second);
    out += "]\n";
  }
  out += "skeleton:\n";
  for (const FittedPrimitive& p : object.primitives) put_primitive(out, p);
  return out;
}

std::string report_json(const FitReport& r) {
  const auto distance = [](const Distance& d) { return nlohmann::ordered_json{{"rms", d.rms}, {"largest", d.largest}}; };
  nlohmann::ordered_json out;
  out["diagonal"] = r.diagonal;
  out["repair"] = {{"vertices", r.repair.vertices}, {"triangles", r.repair.triangles}, {"holes", r.repair.holes}, {"closed_area", r.repair.closed_area}, {"pieces", r.repair.pieces}, {"turned", r.repair.turned}};
  if (r.repair.points > 0) out["points"] = {{"number", r.repair.points}, {"normals_given", r.repair.normals_given}, {"rms", r.repair.points_rms}};
  if (r.repair.voxels > 0) out["volume_data"] = {{"voxels", r.repair.voxels}, {"cavities", r.repair.cavities}, {"cut", r.repair.cut}};
  out["from_data"] = distance(r.from_data);
  out["to_data"] = distance(r.to_data);
  out["two_sided"] = r.two_sided();
  out["within"] = r.within;
  out["volume"] = r.volume;
  out["volume_error"] = r.volume_error;
  out["genus"] = {{"data", r.genus_in}, {"fit", r.genus_out}};
  out["pieces"] = r.pieces_out;
  out["primitives"] = r.primitives;
  out["particles"] = r.particles;
  out["bonds"] = r.bonds;
  out["rigid"] = r.rigid;
  out["seconds"] = r.seconds;
  out["warnings"] = r.warnings;
  return out.dump(2) + '\n';
}

std::string report_text(const FitReport& r) {
  std::string out;
  if (r.repair.points > 0) put(out, "points:     %zu, %s normals; RMS %.3g %% to the surface through them\n", r.repair.points, r.repair.normals_given ? "with" : "without", 100.0 * r.repair.points_rms);
  if (r.repair.voxels > 0) put(out, "voxels:     %zu, %s, %s filled\n", r.repair.voxels, counted(r.repair.pieces, "piece").c_str(), counted(r.repair.cavities, "cavity", "cavities").c_str());
  put(out, "data:       %s, %.4g m across, %s closed\n", counted(r.repair.triangles, "triangle").c_str(), r.diagonal, counted(r.repair.holes, "hole").c_str());
  put(out, "primitives: %zu\nparticles:  %zu, %s%s\n", r.primitives, r.particles, counted(r.bonds, "bond").c_str(), r.rigid ? ", no free modes beyond six" : ", in parts that nothing joins");
  put(out, "distance:   RMS %.3g %%, largest %.3g %% from the data; RMS %.3g %%, largest %.3g %% to it (of the diagonal)\n", 100.0 * r.from_data.rms, 100.0 * r.from_data.largest, 100.0 * r.to_data.rms,
      100.0 * r.to_data.largest);
  put(out, "volume:     %+.2f %%\nhandles:    %ld of %ld\nseconds:    %.1f\n", 100.0 * r.volume_error, r.genus_out, r.genus_in, r.seconds);
  return out;
}

}  // namespace supple::fit
