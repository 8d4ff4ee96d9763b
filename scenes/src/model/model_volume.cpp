#include "model/model_volume.h"

#include <algorithm>
#include <optional>

#include "file/read_scene_faults.h"
#include "model/model_contact.h"

namespace supple::scenes {
namespace {

/// Of the smallest iso radius, where the volume of a ball errs by less than 4e-4; smaller where supports end near the surface.
constexpr double kCell = 1.0 / 6.0, kLeastCell = 1.0 / 24.0;

double cell_of(const ObjectModel& object) {
  double least = object.iso_radius * kCell;
  for (const implicit::Primitive& primitive : object.skeleton.primitive) {
    const double iso = iso_radius(primitive, object.skeleton.iso);
    const double beyond = primitive.kernel.radius / implicit::iso_distance(primitive.kernel, object.skeleton.iso) - 1.0;
    least = std::min(least, iso * std::max(beyond, kLeastCell));
  }
  return least;
}

double support_volume(const implicit::Primitive& primitive) {
  return implicit::support_box(implicit::scaled(primitive, implicit::kLargestScale)).extent().prod();
}

/// Volume of a body of constant shape at a scale of its kernels; none where the measurement would take long.
std::optional<double> volume_at(const ObjectModel& object, double scale) {
  constexpr double kMostCells = 1e5;  // along its surface
  implicit::Skeleton skeleton = object.skeleton;
  for (implicit::Primitive& primitive : skeleton.primitive) primitive = implicit::scaled(primitive, scale);
  const Pose pose;
  implicit::PlacedSkeleton placed;
  implicit::Field field;
  implicit::place_skeleton(skeleton, {&pose, 1}, placed);
  implicit::index_field(skeleton, placed, field);
  const double cell = scale * object.volume_cell;
  const Vec3 cells = implicit::FieldView(field).surface_box().extent() / cell;
  if (2.0 * (cells.x() * cells.y() + cells.y() * cells.z() + cells.z() * cells.x()) > kMostCells) return std::nullopt;
  return implicit::enclosed_volume(field, cell);
}

/// The body of a single particle does not change its shape, so the reachable volumes are known.
void check_reachable(const ObjectModel& object, const std::string& key, ModelFaults& faults) {
  constexpr double kSlack = 0.01;  // far more than volumes err by
  const double target = object.target.front();
  const std::optional<double> least = volume_at(object, implicit::kLeastScale), most = volume_at(object, implicit::kLargestScale);
  if (!(least && target < (1.0 - kSlack) * *least) && !(most && target > (1.0 + kSlack) * *most)) return;
  faults.add(key,
             "expected a volume " + (least && most ? "from " + short_text(*least) + " to " + short_text(*most)
                                     : least       ? "of at least " + short_text(*least)
                                                   : "of at most " + short_text(*most)) +
                 " m^3, for kernels scaled by 1/4 to 4",
             number_text(target), "change the skeleton's kernels or sizes");
}

void check_support(double target, double most, const std::string& key, ModelFaults& faults) {
  if (target <= most) return;
  faults.add_once(key, "expected a volume of at most " + short_text(most) + " m^3, the volume of the supports of kernels scaled by 4",
                  number_text(target), "is it in m^3?");
}

}  // namespace

void hold_volume(const ObjectDesc& d, const std::string& key, std::uint32_t n, std::vector<double> given, ObjectModel& object, ModelFaults& faults) {
  object.holds_volume = true;
  object.volume = {.rate = d.volume->rate, .damping = d.volume->damping};
  object.volume_cell = cell_of(object);
  object.volume_of = d.volume->of;
  if (object.volume_of != VolumeOfName::Primitive) given.assign(object.volume_of == VolumeOfName::Particle ? n : 1, 0.0);
  for (double& target : given) target = target > 0.0 ? target : d.volume->target.value_or(0.0);
  object.target = std::move(given);

  if (!d.volume->target) return;
  const std::string place = key + ".volume.target";
  if (n == 1 && object.target.size() == 1) {
    check_reachable(object, place, faults);
    return;
  }
  std::vector<double> most(object.target.size(), 0.0);
  for (std::size_t k = 0; k < object.skeleton.primitive.size(); ++k) {
    const implicit::Primitive& primitive = object.skeleton.primitive[k];
    most[object.volume_of == VolumeOfName::Primitive ? k : object.volume_of == VolumeOfName::Particle ? primitive.part : 0] +=
        support_volume(primitive);
  }
  for (std::size_t k = 0; k < most.size(); ++k) {
    if (object.target[k] == *d.volume->target) check_support(object.target[k], most[k], place, faults);
  }
}

void check_volume(const implicit::Primitive& primitive, double target, const std::string& key, ModelFaults& faults) {
  check_support(target, support_volume(primitive), key, faults);
}

}  // namespace supple::scenes
