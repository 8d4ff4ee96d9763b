#include "supple/scenes/preview.h"

#include <algorithm>

#include "file/read_scene_faults.h"
#include "supple/scenes/accuracy.h"

namespace supple::scenes {
namespace {

constexpr int kSmaller = 4;             // edges of pictures
constexpr int kLeastEdge = 16;          // [pixel]
constexpr double kCoarserCell = 3.0;
constexpr double kAccuracy = 4e-2;      // steps twice as long as by default
constexpr double kContactError = 0.1;   // of force and area: meshes and samples of contacts are rough then
constexpr double kLeastRate = 12.0, kLeastRateOfLong = 8.0;  // frames per second that still show motion
constexpr int kMostSubsteps = 1 << 20;  // that the keys take
constexpr int kLeastFrames = 9, kLeastFramesOfLong = 12;     // that the film has then, beside the first

/// Video formats take even edges only.
int smaller(int edge) { return std::max(kLeastEdge, edge / kSmaller / 2 * 2); }

/// Steps stay as long as they are.
void add_frame_rate(const Scene& scene, std::vector<std::string>& out) {
  const int every = preview_stride(scene);
  if (every == 1) return;
  out.push_back("frame_rate=" + number_text(scene.frame_rate / every));
  const auto substeps = [every](int n) { return std::to_string(std::min(every * n, kMostSubsteps)); };
  out.push_back("time_step.max_substeps=" + substeps(scene.time_step.max_substeps));
  if (scene.time_step.substeps && !scene.time_step.size) out.push_back("time_step.substeps=" + substeps(*scene.time_step.substeps));
}

void add_meshing(const Scene& scene, const Model& model, std::vector<std::string>& out) {
  if (!(model.cell > 0.0)) return;
  out.push_back("output.cell=" + number_text(kCoarserCell * model.cell));
  out.emplace_back("output.meshing={method: cubes, search: false}");
  for (std::size_t i = 0; i < scene.objects.size(); ++i) {
    const ObjectMeshingDesc& own = scene.objects[i].meshing;
    const std::string key = "objects." + scene.objects[i].name + ".meshing";
    if (own.cell || own.error) out.push_back(key + "={cell: " + number_text(kCoarserCell * model.objects[i].cell) + '}');
  }
}

}  // namespace

int preview_stride(const Scene& scene) {
  int every = 1;
  while (scene.frame_rate / (2 * every) >= kLeastRate && (scene.frame_count() - 1) / (2 * every) >= kLeastFrames) every *= 2;
  const int more = every / 2 * 3;
  if (every > 1 && scene.frame_rate / more >= kLeastRateOfLong && (scene.frame_count() - 1) / more >= kLeastFramesOfLong) every = more;
  return every;
}

std::vector<std::string> preview_overrides(const Scene& scene, const Model& model) {
  std::vector<std::string> out;
  for (const char* key : {"mesh", "grid", "particles", "contacts", "samples"}) out.push_back("output." + std::string(key) + "=none");
  const std::vector<int> size = scene.output.images ? scene.output.images->size : ImagesDesc{}.size;
  out.push_back("output.images={size: [" + std::to_string(smaller(size.at(0))) + ", " + std::to_string(smaller(size.at(1))) + "], samples: 1}");
  if (!scene.output.film && scene.frame_count() > 1) out.emplace_back("output.film=true");
  out.emplace_back("render={renderer: gl}");  // without the keys of the path tracer
  out.push_back("contact.error=" + number_text(std::max(contact_error(scene), kContactError)));
  if (leaves_steps_open(scene)) out.push_back("accuracy=" + number_text(kAccuracy));
  add_frame_rate(scene, out);
  add_meshing(scene, model, out);
  return out;
}

}  // namespace supple::scenes
