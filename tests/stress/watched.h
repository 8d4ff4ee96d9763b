/// @file tests/stress/watched.h
/// Trials that may crash, hang or exhaust memory: they run in a process of their own, which is watched and restarted when it ends early.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

namespace supple::stress {

/// Result of one trial.
struct Trial {
  bool refused = false;   ///< the input was refused with a message
  std::string fault{};    ///< empty: no fault
};

struct Limits {
  double processor_s = 60.0;  ///< of one trial, all threads [s]
  double wall_s = 900.0;      ///< of one trial, for those that wait for ever [s]
  double memory = 6e9;        ///< of the process [byte]; not with sanitizers, which reserve far more
};

struct FoundFault {
  std::uint64_t number = 0;  ///< of the trial
  std::string what;
};

struct Tally {
  std::uint64_t tried = 0;
  std::uint64_t refused = 0;
  std::vector<FoundFault> faults;
};

/// Runs trials first, first + 1, ..., first + count - 1. Output of the trials goes to the end of `log`.
[[nodiscard]] Tally watch(std::uint64_t first, std::uint64_t count, const Limits& limits, const std::filesystem::path& log,
                          const std::function<Trial(std::uint64_t)>& trial);

/// Processor time and memory since it was made.
class Meter {
 public:
  Meter();
  [[nodiscard]] double processor_s() const;
  /// The most that was resident at once beyond what was at the start [byte]; 0 where the system does not let peaks begin anew.
  [[nodiscard]] double most_bytes() const;

 private:
  double begin_s_ = 0.0, begin_bytes_ = 0.0;
  bool peaks_ = false;
};

/// How many times longer things may take in this build: sanitizers slow it down.
[[nodiscard]] double slowness();

}  // namespace supple::stress
