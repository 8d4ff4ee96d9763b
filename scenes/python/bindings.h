/// Declarations that the files of the Python module share: one function per topic, and a simulation as Python holds it.
#pragma once

#include <pybind11/pybind11.h>

#include <atomic>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <utility>

#include "supple/scenes/simulation.h"

namespace supple::python {

namespace py = pybind11;

void bind_errors(py::module_& module);
void bind_scene(py::module_& module);
void bind_runs(py::module_& module);
/// Threads pass one at a time, in the order in which they came.
class Queue {
 public:
  void lock() {
    std::unique_lock hold(mutex_);
    const std::uint64_t mine = last_++;
    passed_.wait(hold, [&] { return first_ == mine; });
  }
  void unlock() {
    {
      const std::lock_guard hold(mutex_);
      ++first_;
    }
    passed_.notify_all();
  }

 private:
  std::mutex mutex_;
  std::condition_variable passed_;
  std::uint64_t first_ = 0, last_ = 0;
};

/// A simulation that several Python threads may use: calls wait for each other without holding the interpreter.
class Handle {
 public:
  Handle(scenes::Scene scene, scenes::SimulationOptions options)
      : simulation_(std::move(scene), options), threads_(options.threads), profile_(options.profile) {}

  /// f(simulation), without the interpreter: f may not touch Python objects.
  template <class F>
  auto use(F&& f) {
    const py::gil_scoped_release others_run;
    const std::lock_guard turn(queue_);
    return std::forward<F>(f)(simulation_);
  }
  /// For what never changes: the scene, and the addresses of arrays.
  [[nodiscard]] const scenes::Simulation& fixed() const { return simulation_; }
  /// Before Python has the object. @pre the state belongs to the scene
  void restore(scenes::State state) { simulation_.restore(std::move(state)); }
  [[nodiscard]] int threads() const { return threads_; }
  [[nodiscard]] bool profile() const { return profile_; }

  std::atomic<bool> cancelled{false};

 private:
  scenes::Simulation simulation_;
  int threads_;
  bool profile_;
  Queue queue_;
};

using Simulation = py::class_<Handle, std::shared_ptr<Handle>>;

/// The class with its basic methods; topics add theirs.
Simulation bind_simulation(py::module_& module);
void bind_particles(py::module_& module, Simulation& simulation);
void bind_contacts(py::module_& module, Simulation& simulation);
void bind_surfaces(py::module_& module, Simulation& simulation);

}  // namespace supple::python
