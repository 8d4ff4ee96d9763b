#include "sweep/measures.h"

#include <fstream>

#include <nlohmann/json.hpp>

namespace supple::scenes {

void check_measures(const SweepPlan& /*plan*/) {}

nlohmann::ordered_json measure_run(const SweepPlan& /*plan*/, const SweepPoint& /*point*/, const std::filesystem::path& folder) {
  std::ifstream file(folder / "result.json");
  const nlohmann::ordered_json report = nlohmann::ordered_json::parse(file, nullptr, false);
  nlohmann::ordered_json values = nlohmann::ordered_json::object();
  if (!report.is_object()) return values;
  for (const char* name : {"frames", "state_hash"}) values[name] = report.value(name, nlohmann::ordered_json());
  return values;
}

}  // namespace supple::scenes
