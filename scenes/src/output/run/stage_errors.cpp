#include "output/run/stage_errors.h"

#include <algorithm>
#include <cmath>
#include <ctime>

#include "supple/core/error.h"

namespace supple::scenes {
namespace {

constexpr std::array<int, 2> kEvery{16, 6};  // one in so many frames is simulated again: of those without contact, and of those with contact
constexpr int kEveryOfContact = 3;          // of these, with a finer contact.error, which costs several times as much
constexpr double kFinerContact = 0.1;       // times contact.error
constexpr double kFinestContact = 1e-10;    // smallest contact.error
constexpr double kFinerTolerance = 1e-2;    // times integrator.tolerance of the adaptive method: what is left of its errors, about
constexpr double kMostWork = 0.1;           // of that of the run, for each stage

/// Contact points of all steps so far.
std::uint64_t points_of(const Simulation& simulation) { return simulation.profile()[static_cast<std::size_t>(Stage::React)].visited; }

/// Counted, so that what is sampled does not depend on the machine: what all stages have visited, and evaluations of fields.
std::uint64_t work_of(const Simulation& simulation) {
  std::uint64_t work = 0;
  for (const StageProfile& stage : simulation.profile()) work += stage.visited + stage.evaluations;
  return work;
}

double thread_cpu_seconds() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
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
  before_work_ = work_of(simulation);
}

void StageErrorEstimator::follow(const Simulation& simulation) {
  const Model& model = simulation.model();
  path_.resize(model.objects.size(), 0.0);
  moved_.assign(model.objects.size(), 0.0);
  for (std::size_t k = 0; k < model.objects.size(); ++k) {
    const ObjectModel& object = model.objects[k];
    for (std::uint32_t i = object.first; i < object.last; ++i) {
      moved_[k] += (simulation.state().particles.position[i] - before_->particles.position[i]).norm() / static_cast<double>(object.last - object.first);
    }
    path_[k] += moved_[k];
  }
}

double StageErrorEstimator::end(const Simulation& simulation) {
  follow(simulation);
  kind_ = points_of(simulation) > touched_ ? 1 : 0;
  work_ = static_cast<double>(work_of(simulation) - before_work_);
  all_work_ += work_;
  const double began = thread_cpu_seconds();
  const core::IntegratorSettings& integrator = simulation.integrator().settings;
  const bool adaptive = integrator.method == core::Integrator::Adaptive, whole = adaptive || simulation.state().halvings == 0;
  const double error = contact_error(scene_), finer_contact = std::max(kFinestContact, kFinerContact * error);
  Variant& time = whole ? finer_ : coarser_;
  const int seen = seen_[kind_]++, sample = seen / kEvery[kind_];
  if (seen % kEvery[kind_] == 0) {
    time.due[kind_] = true;
    // The first frames of a contact tell little.
    contact_.due[kind_] = contact_.due[kind_] || (accuracy_of(scene_) && finer_contact < error && (sample == 0 || sample % kEveryOfContact == 1));
  }
  // Of order p: steps twice as long err by 2^p e, half as long by 2^-p e.
  const double ratio = integrator.method == core::Integrator::BackwardEuler ? 2.0 : 4.0;
  const std::optional<double> kept = scene_.integrator.tolerance;
  if (adaptive) compare_if_due(simulation, {0, error, kFinerTolerance * integrator.tolerance, 1.0 / (1.0 - kFinerTolerance)}, time);
  else compare_if_due(simulation, {whole ? 1 : -1, error, kept, whole ? ratio / (ratio - 1.0) : 1.0 / (ratio - 1.0)}, time);
  compare_if_due(simulation, {0, finer_contact, kept, 1.0}, contact_);
  return thread_cpu_seconds() - began;
}

void StageErrorEstimator::compare_if_due(const Simulation& simulation, const Change& change, Variant& variant) {
  if (!variant.due[kind_] || (variant.frames[kind_] > 0 && variant.spent + variant.cost * work_ > kMostWork * all_work_)) return;
  variant.due[kind_] = false;
  compare(simulation, change, variant);
}

void StageErrorEstimator::compare(const Simulation& simulation, const Change& change, Variant& variant) {
  const Model& model = simulation.model();
  try {
    if (!variant.simulation) {
      Scene scene = scene_;
      scene.contact.error = change.contact_error;
      scene.integrator.tolerance = change.tolerance;
      SimulationOptions options = options_;
      options.finer = change.finer;
      variant.simulation.emplace(std::move(scene), options);
      for (auto& found : variant.found) found.resize(model.objects.size());
    }
    variant.simulation->restore(*before_);
    const std::uint64_t begin = work_of(*variant.simulation);
    variant.simulation->step_frame();
    const auto work = static_cast<double>(work_of(*variant.simulation) - begin);
    if (work_ > 0.0) variant.cost = work / work_;
    variant.spent += work;
  } catch (const Error&) {
    return;  // steps that are too long for this frame give no estimate
  }
  const core::ParticleState &a = simulation.state().particles, &b = variant.simulation->state().particles;
  for (std::size_t k = 0; k < model.objects.size(); ++k) {
    const ObjectModel& object = model.objects[k];
    Difference now{.speed = moved_[k] * scene_.frame_rate, .path = path_[k], .left = (last_frame_ - simulation.frame()) / scene_.frame_rate};
    Vec3 mean = Vec3::Zero();
    for (std::uint32_t i = object.first; i < object.last; ++i) {
      const Vec3 velocity = a.velocity[i] - b.velocity[i];
      now.apart = std::max(now.apart, (a.position[i] - b.position[i]).norm());
      now.velocity = std::max(now.velocity, velocity.norm());
      mean += velocity / static_cast<double>(object.last - object.first);
    }
    if (!object.separate) now.velocity = mean.norm();
    now.apart *= change.share;
    now.velocity *= change.share;
    variant.found[kind_][k].push_back(now);
  }
  ++variant.frames[kind_];
}

/// A difference of velocities lasts as long as the motion itself: until the end where the object keeps its speed, less where it comes to rest. It displaces the
/// object by no more than the way that is left.
double StageErrorEstimator::displacement(const Difference& found, std::size_t object) const {
  const double path = path_[object] - found.path;
  const double lasts = found.speed * found.left > path ? path / found.speed : found.left;
  return found.apart + std::min(lasts * found.velocity, path);
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
      for (std::size_t i = 0; i < variant->found[kind].size(); ++i) {
        for (const Difference& found : variant->found[kind][i]) position[i] += displacement(found, i) * seen_[kind] / frames;
      }
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
  StageErrors out{.time = estimate_of({&coarser_, &finer_}, model), .contact = estimate_of({&contact_}, model), .mesh = {}, .work = all_work_ > 0.0 ? (coarser_.spent + finer_.spent + contact_.spent) / all_work_ : 0.0};
  for (const ObjectModel& object : model.objects) {
    if (!object.mesh_error || *object.mesh_error / size_of(object) <= out.mesh.share) continue;
    out.mesh = {.position = *object.mesh_error, .share = *object.mesh_error / size_of(object), .object = object.name, .frames = 0};
  }
  return out;
}

}  // namespace supple::scenes
