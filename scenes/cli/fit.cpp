#include "fit.h"

#include <array>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <iostream>
#include <optional>

#include "print.h"
#include "supple/core/error.h"
#ifdef SUPPLE_HAS_FIT
#include "supple/core/io/atomic_file.h"
#include "fit_picture.h"
#include "supple/fit/fit.h"
#endif

namespace supple::tool {
namespace {

namespace fs = std::filesystem;

/// 0.01 or 1%.
std::optional<double> share_in(const std::string& text) {
  double value = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  const std::string_view rest(end, text.data() + text.size());
  if (error != std::errc() || !(rest.empty() || rest == "%")) return std::nullopt;
  return rest.empty() ? value : 0.01 * value;
}

/// 100:300.
std::optional<std::array<double, 2>> window_in(const std::string& text) {
  const std::size_t colon = text.find(':');
  if (colon == std::string::npos) return std::nullopt;
  std::array<double, 2> out{};
  const char* from = text.data();
  const char* to = from + colon;
  for (double& value : out) {
    const auto [end, error] = std::from_chars(from, to, value);
    if (error != std::errc() || end != to || !std::isfinite(value)) return std::nullopt;
    from = to + 1;
    to = text.data() + text.size();
  }
  return out;
}

}  // namespace

CLI::App* add_fit(CLI::App& app, FitArguments& a) {
  CLI::App* verb = app.add_subcommand("fit", "make an object for scenes from a mesh, points or a volume");
  verb->add_option("input", a.input, "mesh (.ply, .obj, .off, .stl) or points (.xyz, .ply) in metres, or volume (.nii, .nii.gz, .nrrd, .nhdr, .mha, .mhd, .vdb)")->required();
  verb->add_option("-o,--out", a.out, "file of the object (.yaml); its report is written beside it (.json)")->required();
  verb->add_option_function<std::string>("--error", [&a](const std::string& text) { a.error = share_in(text).value_or(0.0); },
                                         "largest distance between the surfaces, as a share of the diagonal of the data's box (default: 1%)")
      ->check([](const std::string& text) { return share_in(text) ? std::string() : "expected a share such as 1% or 0.01, found " + text; });
  verb->add_option("--particles", a.particles, "number of particles (default: 200)");
  verb->add_option("--primitives", a.primitives, "largest number of primitives of the skeleton (default: 2000)");
  verb->add_option("--pieces", a.pieces, "data of several pieces: refuse (default) or largest")->check(CLI::IsMember({"refuse", "largest"}));
  verb->add_option("--iso", a.iso, "of a volume: values above lie inside");
  verb->add_option_function<std::string>("--window", [&a](const std::string& text) { a.window = window_in(text); }, "of a volume: values FROM:TO lie inside")
      ->check([](const std::string& text) { return window_in(text) ? std::string() : "expected two values such as 100:300, found " + text; });
  verb->add_option("--label", a.label, "of a volume: voxels of this number lie inside")->check(CLI::Range(0U, 16777216U));
  verb->add_option("--picture", a.picture, "a picture (.png) of data and fit side by side, with their distances as colours");
  verb->add_option("--threads", a.threads, "number of threads (default: all); does not change the result")->check(CLI::Range(0, 1024));
  verb->add_flag("--overwrite", a.overwrite, "replace an earlier object");
  verb->add_flag("--quiet", a.quiet, "print warnings and errors only");
  verb->footer("Example: supple fit bunny.off -o bunny.yaml --error 2% --particles 300\n         supple fit head.nii.gz -o head.yaml --iso 40 --pieces largest");
  return verb;
}

#ifdef SUPPLE_HAS_FIT
int fit(const FitArguments& a) {
  const fs::path out = a.out, report = fs::path(a.out).replace_extension(".json");
  if (out.extension() != ".yaml") throw Error(ErrorKind::Usage, Fault{.place = "--out", .key = {}, .expected = "expected a file name that ends in .yaml", .found = '\'' + a.out + '\'', .hint = {}});
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
                                                      .pieces = a.pieces == "largest" ? fit::Pieces::Largest : fit::Pieces::Refuse,
                                                      .volume = {.iso = a.iso, .window = a.window, .label = a.label},
                                                      .threads = a.threads});
  if (!a.picture.empty()) draw_fit(object, a.error, picture);
  io::write_atomically(report, fit::report_json(object.report));
  io::write_atomically(out, fit::object_text(object, fs::path(a.input).filename().string()));
  for (const std::string& warning : object.report.warnings) print(std::cerr, "warning: %s\n", warning.c_str());
  if (a.quiet) return 0;
  std::cout << fit::report_text(object.report);
  print(std::cout, "object:     %s, for a scene: objects: [{name: %s, include: %s, particles: {at: [0, 0, 1]}, scale: 1, material: jelly}]\n", a.out.c_str(), out.stem().c_str(), out.filename().c_str());
  return 0;
}
#else
int fit(const FitArguments& /*a*/) {
  throw Error(ErrorKind::Usage, Fault{.place = "supple fit", .key = {}, .expected = "needs CGAL, without which this program was built", .found = {}, .hint = "install libcgal-dev and build it again"});
}
#endif

}  // namespace supple::tool
