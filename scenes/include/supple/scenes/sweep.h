/// @file supple/scenes/sweep.h
/// Sweeps: a scene run at many points, and one table of their results. `supple sweep` calls these.
///
/// The folder of a sweep holds `sweep.json` (the plan: its points in a fixed order), a folder for each point with the files of its run and its `row.json`, and
/// `table.csv` (the rows). Every step may be taken by another process or machine, and may be taken again: a point that is finished is left as it is.
#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "supple/implicit/delaunay.h"
#include "supple/scenes/limits.h"

namespace supple::scenes {

inline constexpr std::size_t kMostSweepPoints = 100'000;

/// What a sweep is made of.
struct SweepRequest {
  std::filesystem::path scene;
  /// "key=values" each, of which values are
  ///   a:b:N     N values from a to b in equal steps, with units: "1 cm:5 cm:9"
  ///   a:b:logN  the same in equal ratios
  ///   [x, y]    a list of any values: numbers, texts, vectors
  ///   a:b, a:b:log  with `sample`: the range that values are drawn from, uniformly or uniformly in the logarithm
  /// and anything else is one value for all points.
  std::vector<std::string> set{};
  std::string sample{};                   ///< "" for the grid of all combinations, the last key fastest; "random:N"; "lhs:N" (Latin hypercube)
  std::uint64_t seed = 1;                 ///< of samples
  std::filesystem::path measures{};       ///< file of measures (measures.h); empty: none
  std::vector<std::filesystem::path> allowed{};  ///< see read_scene
  bool outputs = false;                   ///< points also write the pictures, meshes, grids and samples that the scene asks for
};

struct SweepPoint {
  int number = 1;                         ///< from 1
  std::string folder;                     ///< below that of the sweep: "point_0001"
  std::vector<std::string> set;           ///< "key=value", of all keys of the sweep
};

struct SweepPlan {
  std::filesystem::path scene;            ///< absolute
  std::vector<std::filesystem::path> allowed;  ///< absolute
  std::vector<std::string> parameters;    ///< keys with several values, in the order asked for
  std::vector<std::string> asked;         ///< SweepRequest::set
  std::string sample;
  std::uint64_t seed = 1;
  std::string measures;                   ///< text of the file; empty: none
  std::string measures_name;              ///< its path, for messages
  bool outputs = false;
  std::vector<SweepPoint> points;
};

/// @throws Error{Usage} for values that cannot be read, keys given twice, no key with several values, more than kMostSweepPoints points; Error{Scene} for
/// keys and values that the scene does not have, and for faults in the measures; Error{Io}
[[nodiscard]] SweepPlan plan_sweep(const SweepRequest& request);

/// Writes sweep.json. Makes the folder.
/// @throws Error{Io}, also where the folder holds another plan and `replace` is false
void write_plan(const std::filesystem::path& folder, const SweepPlan& plan, bool replace = false);
/// @throws Error{Io} where there is none, or one that cannot be read
[[nodiscard]] SweepPlan read_plan(const std::filesystem::path& folder);

/// How one point ended.
struct SweepRow {
  int number = 1;
  std::string outcome;     ///< as RunResult; "missing": not run yet; "unfinished": its run was broken off or goes on; "crashed": its process ended without a report
  std::string reason;      ///< empty when done
  int exit_code = 0;
  bool kept = false;       ///< it was finished before
  /// The outcome follows from the scene alone: the point is not run again. Others (interrupted, limit, io, crashed ...) are.
  [[nodiscard]] bool finished() const { return outcome == "done" || outcome == "diverged" || outcome == "invalid"; }
};

struct PointOptions {
  int threads = 1;                             ///< 0: all of the machine; does not change results
  double memory = kDefaultMemory;              ///< limit of memory for the scene [byte]
  double time_limit = 0.0;                     ///< see RunOptions::time_limit [s]
  implicit::DelaunayMesher delaunay{};
  const std::atomic<int>* interrupt = nullptr; ///< see RunOptions::interrupt
};

/// Runs one point and writes its row, in its own folder only. A point whose row is finished and belongs to this scene, build and measures is left as it is;
/// a run that was broken off goes on from its last state.
/// @throws Error{Usage} for a number that the plan does not have; Error{Io} where a file cannot be written or the point is being run by another process
SweepRow run_point(const std::filesystem::path& folder, int number, const PointOptions& options = {});

struct SweepProgress {
  int done = 0;     ///< points that have ended, kept ones included
  int count = 0;
  int failed = 0;   ///< of `done`: not "done"
};

struct SweepOptions {
  int jobs = 0;                                ///< points that run at the same time; 0: one per processor
  /// Command line that runs a point, to which the folder, "--point" and the number are added: each runs in a process of its own, so that none can end the others.
  std::vector<std::string> command{};
  std::function<void(const SweepProgress&)> progress{};  ///< never called by two threads at the same time; may be empty
  const std::atomic<int>* interrupt = nullptr; ///< non-zero: the points under way are ended; the next call goes on with them
};

/// Runs every point that is not finished, then collects. @return the rows of all points, by number
/// @throws Error{Io} where another process runs this sweep; Interrupted
std::vector<SweepRow> run_sweep(const std::filesystem::path& folder, const SweepOptions& options);

/// Joins the rows of all points into table.csv: number, keys, outcome, measures, reason; of points that were not run the measures are empty.
/// @return the path of the table
/// @throws Error{Io}
std::filesystem::path collect_sweep(const std::filesystem::path& folder);

}  // namespace supple::scenes
