#include <algorithm>
#include <filesystem>
#include <optional>
#include <system_error>
#include <utility>

#include "file/fields/fields_particles.h"
#include "file/named_files.h"
#include "file/scene_places.h"
#include "model/arrangement.h"
#include "model/model_laws.h"
#include "output/files/output_files.h"
#include "output/pictures/frame_looks.h"
#include "supple/core/pair_laws.h"
#include "supple/scenes/limits.h"

namespace supple::scenes {
namespace {

/// Fewer pairs than this need too little memory to be counted.
constexpr double kFewPairs = 1e3;

class SceneCounter {
 public:
  explicit SceneCounter(const Scene& scene) : scene_(scene), particles_(scene.objects.size()), number_(scene.objects.size()) {
    for (std::size_t i = 0; i < scene.objects.size(); ++i) {
      const std::optional<int> known = particle_count(scene.objects[i].particles);
      number_[i] = known ? static_cast<std::uint64_t>(*known) : places(i).size();
    }
  }

  SceneCounts counts(double others) {
    count_files();
    count_images();
    for (std::size_t i = 0; i < scene_.objects.size(); ++i) count_object(i);
    count_laws_between();
    counts_.with_pairs = counts_.undrawn_bytes() <= others;
    if (!counts_.with_pairs) return std::move(counts_);
    for (std::size_t i = 0; i < scene_.objects.size(); ++i) count_pairs(i);
    count_pairs_between();
    return std::move(counts_);
  }

 private:
  void add(Counted what, std::string key, double number, bool estimated = false) {
    if (number > 0.0) counts_.count.push_back({.what = what, .key = std::move(key), .number = number, .estimated = estimated});
  }
  [[nodiscard]] std::string key_of(std::size_t object) const { return "objects." + scene_.objects[object].name; }

  void add_file(const std::string& file, const std::string& key) {
    std::error_code error;
    const std::uintmax_t size = std::filesystem::file_size(readable_file(files_of(scene_), file), error);  // others are reported where they are read
    if (!error) add(Counted::FileBytes, key, static_cast<double>(size));
  }
  void count_files() {
    for (const ObjectDesc& d : scene_.objects) {
      if (d.particles.arrange == ArrangeKind::File) add_file(d.particles.file, "objects." + d.name + ".particles.file");
      add_texture(d.look.texture, "objects." + d.name + ".look.texture.file");
    }
    for (const ObstacleDesc& d : scene_.obstacles) {
      if (!d.file.empty()) add_file(d.file, "obstacles." + d.name + ".file");
      add_texture(d.texture, "obstacles." + d.name + ".texture.file");
    }
    if (scene_.ground) add_texture(scene_.ground->texture, "ground.texture.file");
  }
  void add_texture(const std::optional<TextureDesc>& texture, const std::string& key) {
    if (!texture || texture->pattern != PatternName::Picture) return;
    const std::filesystem::path path = readable_file(files_of(scene_), texture->file);
    if (path.empty()) return;
    const auto [width, height] = picture_size(path);
    add(Counted::TexturePixels, key, static_cast<double>(width) * static_cast<double>(height));
  }
  /// The number of frames at a time depends on the free memory.
  void count_images() {
    if (!scene_.output.images) return;
    const ImagesDesc& d = *scene_.output.images;
    add(Counted::ImageSamples, "output.images.size", static_cast<double>(d.size.at(0)) * d.size.at(1) * d.samples);
  }

  void count_object(std::size_t i) {
    const ObjectDesc& d = scene_.objects[i];
    const std::string key = key_of(i);
    const auto n = static_cast<double>(number_[i]);
    add(Counted::Particles, key + ".particles", n);
    double primitives = 0.0;
    constexpr double kPointsOfOne = 8.0;  // control points take as much memory as a primitive
    for (const SkeletonDesc& s : d.skeleton) {
      primitives += (s.particles.empty() ? n : static_cast<double>(s.particles.size())) * (1.0 + static_cast<double>(s.points.size()) / kPointsOfOne);
    }
    add(Counted::Primitives, key + ".skeleton", primitives);
    // Components and groups of a blending graph are bodies of their own; there are at most as many as particles.
    const bool divided = d.blend && d.blend->rule == BlendName::Graph && d.contact && d.contact->self.value_or(true);
    add(Counted::Bodies, key + (d.separate ? ".separate" : divided ? ".blend" : ""), d.separate || divided ? n : 1.0);
    for (std::size_t k = 0; k < d.interactions.size(); ++k) {
      const InteractionDesc& law = d.interactions[k];
      if (law.geometric || law.within) continue;
      const Counted what = law.law == LawKind::Friction ? Counted::FrictionBonds : Counted::Bonds;
      add(what, law_key(i, k) + ".neighbours", static_cast<double>(core::count_bonds_along(number_[i], law.neighbours)));
    }
    if (d.material && !d.separate && n > 1.0) {
      constexpr double kBondsOfParticle = 18.0;  // of a block: nine pairs, each with a spring along it and a frame
      add(Counted::Bonds, key + ".material", kBondsOfParticle * n);
    }
    if (d.blend && d.blend->neighbours) {
      add(Counted::NeighbourPairs, key + ".blend.neighbours", static_cast<double>(core::count_bonds_along(number_[i], *d.blend->neighbours)));
    }
  }
  [[nodiscard]] std::string law_key(std::size_t object, std::size_t k) const { return key_of(object) + ".interactions[" + std::to_string(k) + ']'; }

  void count_laws_between() {
    double with = 0.0;
    std::size_t last = 0;
    for (std::size_t i = 0; i < scene_.objects.size(); ++i) {
      if (!scene_.objects[i].repulsion) continue;
      with += 1.0;
      last = i;
    }
    if (with > 0.0) add(Counted::Laws, key_of(last) + ".repulsion", 0.5 * with * (with + 1.0));
  }

  void count_pairs(std::size_t i) {
    const ObjectDesc& d = scene_.objects[i];
    for (std::size_t k = 0; k < d.interactions.size(); ++k) {
      const InteractionDesc& law = d.interactions[k];
      const std::string key = law_key(i, k);
      if (law.geometric) {
        add_near(Counted::NeighbourPairs, law.within ? key + ".within" : key, geometric_range(law).value_or(0.0), i);
      } else if (law.within) {
        add_near(law.law == LawKind::Friction ? Counted::FrictionBonds : Counted::Bonds, key + ".within", *law.within, i);
      }
    }
    if (d.blend && d.blend->within) add_near(Counted::NeighbourPairs, key_of(i) + ".blend.within", *d.blend->within, i);
    if (d.repulsion && (d.repulsion->own || !d.kinds.empty())) {
      add_near(Counted::NeighbourPairs, key_of(i) + ".repulsion", core::Repulsion{d.repulsion->force, d.repulsion->distance, d.repulsion->length}.cut_off(), i);
    }
  }

  /// Objects that both have a surface and touch do not repel each other; they are counted all the same.
  void count_pairs_between() {
    for (std::size_t a = 0; a < scene_.objects.size(); ++a) {
      const std::optional<RepulsionDesc>& x = scene_.objects[a].repulsion;
      for (std::size_t b = a + 1; x && b < scene_.objects.size(); ++b) {
        const std::optional<RepulsionDesc>& y = scene_.objects[b].repulsion;
        if (!y || (scene_.objects[a].contact && scene_.objects[b].contact)) continue;
        const double range = core::Repulsion{0.0, 0.5 * (x->distance + y->distance), 0.5 * (x->length + y->length)}.cut_off();
        const double most = static_cast<double>(number_[a]) * static_cast<double>(number_[b]);
        if (most <= kFewPairs) continue;
        std::vector<Vec3> all = places(a);
        all.insert(all.end(), places(b).begin(), places(b).end());
        add_near(Counted::NeighbourPairs, key_of(x->distance + x->length < y->distance + y->length ? b : a) + ".repulsion", range, all);
      }
    }
  }

  void add_near(Counted what, std::string key, double range, std::size_t object) {
    const auto n = static_cast<double>(number_[object]);
    if (!(range > 0.0)) return;
    if (0.5 * n * (n - 1.0) <= kFewPairs) {
      add(what, std::move(key), 0.5 * n * (n - 1.0));
    } else {
      add_near(what, std::move(key), range, places(object));
    }
  }
  void add_near(Counted what, std::string key, double range, const std::vector<Vec3>& places) {
    const core::BondCount found = core::count_bonds_within(places, range);
    add(what, std::move(key), static_cast<double>(found.number), found.estimated);
  }

  /// Of the particles of an object; none where their file cannot be read, which the model reports.
  const std::vector<Vec3>& places(std::size_t object) {
    if (!particles_[object]) {
      ModelFaults unused(scene_);
      particles_[object] = arrange(scene_, scene_.objects[object].particles, key_of(object) + ".particles", unused).position;
    }
    return *particles_[object];
  }

  const Scene& scene_;
  std::vector<std::optional<std::vector<Vec3>>> particles_;
  std::vector<std::uint64_t> number_;
  SceneCounts counts_;
};

}  // namespace

SceneCounts count_scene(const Scene& scene, double others) { return SceneCounter(scene).counts(others); }

}  // namespace supple::scenes
