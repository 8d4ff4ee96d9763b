#include "supple/scenes/preview.h"

#include <algorithm>

#include "file/read_scene_faults.h"
#include "supple/scenes/accuracy.h"
#include "supple/scenes/model.h"

namespace supple::scenes {
namespace {

constexpr int kSmaller = 4;             // edges of pictures
constexpr int kLeastEdge = 16;          // [pixel]
constexpr double kCoarserCell = 2.0;
constexpr double kContactError = 3e-2;  // of force and area

/// Video formats take even edges only.
int smaller(int edge) { return std::max(kLeastEdge, edge / kSmaller / 2 * 2); }

void add_meshing(const Scene& scene, std::vector<std::string>& out) {
  const Model model = build_model(scene);
  if (!(model.cell > 0.0)) return;
  out.push_back("output.cell=" + number_text(kCoarserCell * model.cell));
  out.emplace_back("output.meshing={search: false}");
  for (std::size_t i = 0; i < scene.objects.size(); ++i) {
    const ObjectMeshingDesc& own = scene.objects[i].meshing;
    const std::string key = "objects." + scene.objects[i].name + ".meshing";
    if (own.cell || own.error) out.push_back(key + "={cell: " + number_text(kCoarserCell * model.objects[i].cell) + '}');
  }
}

}  // namespace

std::vector<std::string> preview_overrides(const Scene& scene) {
  std::vector<std::string> out;
  for (const char* key : {"mesh", "grid", "particles", "contacts", "samples"}) out.push_back("output." + std::string(key) + "=none");
  const std::vector<int> size = scene.output.images ? scene.output.images->size : ImagesDesc{}.size;
  out.push_back("output.images={size: [" + std::to_string(smaller(size.at(0))) + ", " + std::to_string(smaller(size.at(1))) + "], samples: 1}");
  if (!scene.output.film) out.emplace_back("output.film=true");
  out.emplace_back("render.renderer=gl");
  out.push_back("contact.error=" + number_text(std::max(contact_error(scene), kContactError)));
  if (scene.accuracy && leaves_steps_open(scene)) out.push_back("accuracy=" + number_text(kDefaultAccuracy));
  add_meshing(scene, out);
  return out;
}

}  // namespace supple::scenes
