#include "output/stage_errors.h"

#include <algorithm>
#include <cmath>
#include <ctime>

#include "supple/core/error.h"

namespace supple::scenes {
namespace {

constexpr std::array<int, 2> kEvery{16, 6};  // one in so many frames is simulated again: of those without contact, and of those with contact
constexpr double kFinerContact = 0.1;       // times contact.error
constexpr double kFinestContact = 1e-10;    // smallest contact.error

/// Contact points of all steps so far.
std::uint64_t points_of(const Simulation& simulation) { return simulation.profile()[static_cast<std::size_t>(Stage::React)].visited; }

double thread_cpu_seconds() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

/// Difference at the end of the run of two simulations of a frame: the largest difference of positions, plus the drift of the object as a whole by the
/// difference of its velocity, as if it moved freely from there on.
double difference(const ObjectModel& object, const core::ParticleState& a, const core::ParticleState& b, double left) {
  double farthest = 0.0;
  Vec3 drift = Vec3::Zero();
  for (std::uint32_t i = object.first; i < object.last; ++i) {
    const Vec3 velocity = a.velocity[i] - b.velocity[i];
    const double apart = (a.position[i] - b.position[i]).norm();
    farthest = std::max(farthest, object.separate ? apart + left * velocity.norm() : apart);
    drift += velocity / static_cast<double>(object.last - object.first);
  }
  return object.separate ? farthest : farthest + left * drift.norm();
}

}  // namespace

StageErrorEstimator::StageErrorEstimator(const Scene& scene, const SimulationOptions& options, int last_frame)
    : scene_(scene), options_(options), last_frame_(last_frame) {
  options_.threads = 1;
  options_.profile = false;
  options_.questions = true;
}

void StageErrorEstimator::begin(const Simulation& simulation) {
  before_ = simulation.state();
  touched_ = points_of(simulation);
}

double StageErrorEstimator::end(const Simulation& simulation) {
  kind_ = points_of(simulation) > touched_ ? 1 : 0;
  if (seen_[kind_]++ % kEvery[kind_] != 0) return 0.0;
  const double began = thread_cpu_seconds();
  const bool whole = simulation.state().halvings == 0;
  const double error = contact_error(scene_);
  compare(simulation, whole ? 1 : -1, error, whole ? finer_ : coarser_);
  const double finer_contact = std::max(kFinestContact, kFinerContact * error);
  if (accuracy_of(scene_) && finer_contact < error) compare(simulation, 0, finer_contact, contact_);
  return thread_cpu_seconds() - began;
}

void StageErrorEstimator::compare(const Simulation& simulation, int finer, double contact_error, Variant& variant) {
  const Model& model = simulation.model();
  try {
    if (!variant.simulation) {
      Scene scene = scene_;
      scene.contact.error = contact_error;
      SimulationOptions options = options_;
      options.finer = finer;
      variant.simulation.emplace(std::move(scene), options);
      for (auto& sum : variant.sum) sum.assign(model.objects.size(), 0.0);
    }
    variant.simulation->restore(*before_);
    variant.simulation->step_frame();
  } catch (const Error&) {
    return;  // steps that are too long for this frame give no estimate
  }
  const double left = (last_frame_ - simulation.frame()) / scene_.frame_rate;
  for (std::size_t i = 0; i < model.objects.size(); ++i) {
    variant.sum[kind_][i] += difference(model.objects[i], simulation.state().particles, variant.simulation->state().particles, left);
  }
  ++variant.frames[kind_];
}

/// Sums are scaled from the frames that were simulated again to all frames of their kind.
ErrorEstimate StageErrorEstimator::estimate_of(std::initializer_list<const Variant*> variants, const Model& model) const {
  ErrorEstimate out;
  std::vector<double> position(model.objects.size(), 0.0);
  for (std::size_t kind = 0; kind < seen_.size(); ++kind) {
    int frames = 0;
    for (const Variant* variant : variants) frames += variant->frames[kind];
    if (frames == 0) continue;
    out.frames += frames;
    for (const Variant* variant : variants) {
      for (std::size_t i = 0; i < variant->sum[kind].size(); ++i) position[i] += variant->sum[kind][i] * seen_[kind] / frames;
    }
  }
  for (std::size_t i = 0; out.frames > 0 && i < position.size(); ++i) {
    const double share = position[i] / size_of(model.objects[i]);
    if (!out.object.empty() && !(share > out.share)) continue;
    out.position = position[i];
    out.share = share;
    out.object = model.objects[i].name;
  }
  return out;
}

StageErrors StageErrorEstimator::estimate(const Model& model) const {
  StageErrors out{.time = estimate_of({&coarser_, &finer_}, model), .contact = estimate_of({&contact_}, model), .mesh = {}};
  for (const ObjectModel& object : model.objects) {
    if (!object.mesh_error || *object.mesh_error / size_of(object) <= out.mesh.share) continue;
    out.mesh = {.position = *object.mesh_error, .share = *object.mesh_error / size_of(object), .object = object.name, .frames = 0};
  }
  return out;
}

}  // namespace supple::scenes
