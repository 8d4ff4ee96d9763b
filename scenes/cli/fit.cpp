#include "fit.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <optional>
#include <string_view>
#include <vector>

#include "installed_program.h"
#include "supple/core/error.h"

namespace supple::tool {
namespace {

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

std::optional<std::uint32_t> piece_in(const std::string& text) {
  if (text == "largest") return 1;
  std::uint32_t number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  return error == std::errc() && end == text.data() + text.size() && number > 0 ? std::optional(number) : std::nullopt;
}

CLI::App* add_fit(CLI::App& app, FitArguments& a) {
  CLI::App* verb = app.add_subcommand("fit", kFitMeaning);
  add_fit_options(*verb, a);
  return verb;
}

void add_fit_options(CLI::App& verb, FitArguments& a) {
  verb.add_option("input", a.input, "mesh (.ply, .obj, .off, .stl) or points (.xyz, .ply) in metres, or volume (.nii, .nii.gz, .nrrd, .nhdr, .mha, .mhd, .vdb)")->required();
  verb.add_option("-o,--out", a.out, "file of the object (.yaml); its report is written beside it (.json)")->required();
  verb.add_option_function<std::string>("--error", [&a](const std::string& text) { a.error = share_in(text).value_or(0.0); },
                                         "largest distance between the surfaces, as a share of the diagonal of the data's box (default: 1%)")
      ->check([](const std::string& text) { return share_in(text) ? std::string() : "expected a share such as 1% or 0.01, found " + text; });
  verb.add_option("--particles", a.particles, "number of particles (default: 200)");
  verb.add_option("--primitives", a.primitives, "largest number of primitives of the skeleton (default: 2000)");
  verb.add_option("--kind", a.kind, "solid (default), or shell: a layer about a surface, which may be open")->check(CLI::IsMember({"solid", "shell"}));
  verb.add_option("--thickness", a.thickness, "of a shell [m] (default: a third of the distance between particles)");
  verb.add_option("--material", a.material, "of the object: the name of a material of supple:materials (jelly, rubber ...), or a file of scenes with the key 'material'");
  verb.add_option("--pieces", a.pieces, "data of several pieces: refuse (default), largest, or the number of one counted from the largest")
      ->check([](const std::string& text) { return text == "refuse" || piece_in(text) ? std::string() : "expected refuse, largest or a number from 1, found " + text; });
  verb.add_option("--iso", a.iso, "of a volume: values above lie inside");
  verb.add_option_function<std::string>("--window", [&a](const std::string& text) { a.window = window_in(text); }, "of a volume: values FROM:TO lie inside")
      ->check([](const std::string& text) { return window_in(text) ? std::string() : "expected two values such as 100:300, found " + text; });
  verb.add_option("--label", a.label, "of a volume: voxels of this number lie inside")->check(CLI::Range(0U, 16777216U));
  verb.add_option("--picture", a.picture, "a picture (.png) of data and fit side by side, with their distances as colours");
  verb.add_option("--threads", a.threads, "number of threads (default: all); does not change the result")->check(CLI::Range(0, 1024));
  verb.add_flag("--overwrite", a.overwrite, "replace an earlier object");
  verb.add_flag("--quiet", a.quiet, "print warnings and errors only");
  verb.footer("Example: supple fit bunny.off -o bunny.yaml --error 2% --particles 300\n         supple fit head.nii.gz -o head.yaml --iso 40 --pieces largest");
}

void start_fit(std::span<char* const> words, bool silent) {
  const std::filesystem::path program = installed_program("supple_fit");
  if (program.empty()) {
    throw Error(ErrorKind::Io, Fault{.place = "supple_fit",
                                     .key = {},
                                     .expected = "expected the program of fits beside the tool or in libexec/supple",
                                     .found = "none",
                                     .hint = "in a source tree: install libcgal-dev, then cmake --preset release -DSUPPLE_CGAL=ON && cmake --build build/release --target supple_fit_program"});
  }
  const auto verb = std::find(words.begin() + 1, words.end(), std::string_view("fit"));
  std::vector<std::string> own(verb + 1, words.end());
  if (silent) own.insert(own.begin(), "--quiet");
  become_program(program, std::move(own));
}

}  // namespace supple::tool
