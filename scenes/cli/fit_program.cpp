/// The program `supple_fit`, which `supple fit` starts with its own options.
#include <filesystem>
#include <iostream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string_view>
#include <utility>
#include <vector>

#include "fit.h"
#include "fit_picture.h"
#include "print.h"
#include "program.h"
#include "supple/core/error.h"
#include "supple/core/io/atomic_file.h"
#include "supple/fit/fit.h"
#include "supple/scenes/read_scene.h"

namespace {

using namespace supple;
using tool::print;
namespace fs = std::filesystem;

/// A scene of one object that is made for its material. Its faults are those of the option, or of the file that the option names.
scenes::Scene parsed_material(const std::string& text, const fs::path& folder) {
  constexpr std::string_view kOption = "--material", kObject = "objects[0].";
  try {
    return scenes::parse_scene(text, std::string(kOption), folder);
  } catch (const Error& error) {
    std::vector<Fault> faults = error.faults();
    for (Fault& fault : faults) {
      if (fault.key.starts_with(kObject)) fault.key.erase(0, kObject.size());
      if (!fault.place.starts_with(kOption)) continue;  // of the file
      fault.place = kOption;
      if (fault.key == "material") fault.expected = "expected the name of a material, or a file of scenes with the key 'material'";
      fault.key.clear();
    }
    throw Error(error.kind(), std::move(faults));
  }
}

/// The material of a file of scenes, or a shipped one by its name: read like that of an object.
fit::Substance material_of(const std::string& given) {
  if (given.empty()) return {};
  const fs::path file = given;
  const bool named = !file.has_extension() && !file.has_parent_path();
  const auto quoted = [](const std::string& text) { return nlohmann::json(text).dump(-1, ' ', false, nlohmann::json::error_handler_t::replace); };
  const std::string text = std::string("schema: 1\nduration: 1\n") + (named ? "include: supple:materials\n" : "") + "objects:\n  - " +
                           (named ? "material: " + quoted(given) : "include: " + quoted(file.filename().string())) +
                           "\n    name: fitted\n    particles: {arrange: single}\n    skeleton: [{shape: point, kernel: {radius: 1}}]\n";
  const scenes::Scene scene = parsed_material(text, file.parent_path());
  const auto& found = scene.objects.front().material;
  if (!found) throw Error(ErrorKind::Scene, Fault{.place = given, .key = "material", .expected = "expected the key 'material'", .found = "none", .hint = "write material: {youngs_modulus: 20 kPa, density: 1050 kg/m^3}"});
  return {.youngs_modulus = found->youngs_modulus, .density = found->density, .poissons_ratio = found->poissons_ratio, .damping_ratio = found->damping_ratio, .friction = found->friction};
}

int make_object(const tool::FitArguments& a) {
  const fs::path out = a.out, report = fs::path(a.out).replace_extension(".json");
  if (out.extension() != ".yaml" && out.extension() != ".yml") throw Error(ErrorKind::Usage, Fault{.place = "--out", .key = {}, .expected = "expected a file name that ends in .yaml or .yml", .found = '\'' + a.out + '\'', .hint = {}});
  const fs::path picture = a.picture;
  if (!a.picture.empty() && picture.extension() != ".png") {
    throw Error(ErrorKind::Usage, Fault{.place = "--picture", .key = {}, .expected = "expected a file name that ends in .png", .found = '\'' + a.picture + '\'', .hint = {}});
  }
  for (const fs::path& path : {out, report, picture}) {
    if (!a.overwrite && !path.empty() && fs::exists(path)) throw Error(ErrorKind::Usage, Fault{.place = path.string(), .key = {}, .expected = "exists", .found = {}, .hint = "replace it by --overwrite"});
  }
  const fit::FittedObject object = fit::fit(a.input, {.error = a.error,
                                                      .particles = a.particles,
                                                      .primitives = a.primitives,
                                                      .pieces = tool::piece_in(a.pieces) ? fit::Pieces::Largest : fit::Pieces::Refuse,
                                                      .piece = tool::piece_in(a.pieces).value_or(1),
                                                      .kind = a.kind == "shell" ? fit::Kind::Shell : fit::Kind::Solid,
                                                      .thickness = a.thickness,
                                                      .volume = {.iso = a.iso, .window = a.window, .label = a.label},
                                                      .material = material_of(a.material),
                                                      .threads = a.threads});
  if (!a.picture.empty()) tool::draw_fit(object, a.error, picture);
  io::write_atomically(report, fit::report_json(object.report));
  io::write_atomically(out, fit::object_text(object, fs::path(a.input).filename().string()));
  for (const std::string& warning : object.report.warnings) print(std::cerr, "warning: %s\n", warning.c_str());
  if (a.quiet) return 0;
  std::cout << fit::report_text(object.report);
  print(std::cout, "object:     %s, for a scene: objects: [{name: %s, include: %s, particles: {at: [0, 0, 1]}, scale: 1, material: jelly}]\n", a.out.c_str(), out.stem().c_str(), out.filename().c_str());
  return 0;
}

int parse_and_fit(int argc, char** argv, bool silent) {
  tool::FitArguments arguments;
  arguments.quiet = silent;
  CLI::App app(tool::kFitMeaning, "supple fit");
  tool::add_fit_options(app, arguments);
  try {
    app.parse(argc, argv);
  } catch (const CLI::Success& help) {
    return app.exit(help);
  } catch (const CLI::ParseError& error) {
    std::ostringstream text;
    app.exit(error, text, text);
    std::cerr << tool::printable_lines(text.str());
    return static_cast<int>(ErrorKind::Usage);
  }
  return make_object(arguments);
}

}  // namespace

int main(int argc, char** argv) { return supple::tool::run_program(argc, argv, parse_and_fit); }
