/// @file measures.h
/// Columns of the table of a sweep: values of result.json, contact of a pair as it was booked step by step, and reductions of tables that have a row for every
/// frame.
///
///     peak: {pair: [ball, floor], take: peak_force}                                   # every step
///     hop: {frames: particles, of: ball, column: z_m, across: mean, reduce: max}      # at frames
///     lost: {frames: energies, column: dissipated_j, reduce: final}
///     deformed: {result: objects.ball.largest_deformation}
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "file/fields/fields_archive.h"
#include "supple/scenes/sweep.h"

namespace supple::scenes {

enum class TakeName : std::uint8_t { PeakForce, PeakTime, Impulse, ContactTime, FirstTouch, FirstContactTime, ApproachSpeed, ReboundSpeed, Restitution, LargestDepth, DepthAtRest, Touches };
enum class FrameTableName : std::uint8_t { Energies, Objects, Particles, Contacts };
enum class ReduceName : std::uint8_t { Min, Max, Mean, Final, PeakTime, Integral };
enum class AcrossName : std::uint8_t { Auto, Sum, Mean, Min, Max };

template <> struct EnumNames<TakeName> {
  static constexpr std::array<std::string_view, 12> names{"peak_force",     "peak_time",     "impulse",     "contact_time",  "first_touch",   "first_contact_time",
                                                          "approach_speed", "rebound_speed", "restitution", "largest_depth", "depth_at_rest", "touches"};
};
template <> struct EnumNames<FrameTableName> {
  static constexpr std::array<std::string_view, 4> names{"energies", "objects", "particles", "contacts"};
};
template <> struct EnumNames<ReduceName> {
  static constexpr std::array<std::string_view, 6> names{"min", "max", "mean", "final", "peak_time", "integral"};
};
template <> struct EnumNames<AcrossName> {
  static constexpr std::array<std::string_view, 5> names{"auto", "sum", "mean", "min", "max"};
};

struct Measure {
  enum class Kind : std::uint8_t { Result, Pair, Frames };
  Kind kind = Kind::Result;
  std::string name;
  std::string result;                    ///< path in result.json
  std::vector<std::string> pair;         ///< two objects or obstacles
  TakeName take = TakeName::PeakForce;   ///< Pair
  FrameTableName frames = FrameTableName::Energies;  ///< Frames: table with rows at frames
  std::string of;                        ///< object whose rows count; empty: all
  std::string column;
  AcrossName across = AcrossName::Auto;  ///< several rows of a frame; Auto: the sum of contacts, else the mean
  ReduceName reduce = ReduceName::Final;
};

/// @param text  YAML   @param name  of the file, for messages   @throws Error{Scene} with every fault
[[nodiscard]] std::vector<Measure> read_measures(const std::string& text, const std::string& name);

/// Checks the measures of a plan against its scene at the first point. @throws Error{Scene}
void check_measures(const SweepPlan& plan);

/// The values of a finished run, in the order of the measures; without measures a choice of result.json and the contact of every pair that touched.
/// @param folder  of the run   @throws Error
[[nodiscard]] nlohmann::ordered_json measure_run(const SweepPlan& plan, const SweepPoint& point, const std::filesystem::path& folder);

}  // namespace supple::scenes
