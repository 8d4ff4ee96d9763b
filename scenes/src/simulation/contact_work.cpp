#include "simulation/contact_work.h"

#include <algorithm>
#include <map>
#include <string>

#include "supple/core/error.h"

namespace supple::scenes {

void book_pair_work(std::span<const collision::ContactSurface::Summary> pairs, std::span<const double> power, double step, RunRecord& record) {
  SUPPLE_EXPECTS(power.empty() || power.size() == pairs.size());
  std::vector<RunRecord::PairWork>& all = record.pair_work;
  const auto book = [step](RunRecord::PairWork& pair, double now) {
    pair.work += 0.5 * step * (pair.power + now);
    pair.power = now;
  };
  const std::size_t known = all.size();
  std::size_t at = 0;
  for (std::size_t k = 0; k < power.size(); ++k) {
    for (; at < known && all[at].bodies < pairs[k].bodies; ++at) book(all[at], 0.0);
    if (at < known && all[at].bodies == pairs[k].bodies) {
      book(all[at++], power[k]);
    } else if (power[k] != 0.0) {
      book(all.emplace_back(RunRecord::PairWork{.bodies = pairs[k].bodies}), power[k]);
    }
  }
  for (; at < known; ++at) book(all[at], 0.0);
  std::inplace_merge(all.begin(), all.begin() + static_cast<std::ptrdiff_t>(known), all.end(),
                     [](const RunRecord::PairWork& a, const RunRecord::PairWork& b) { return a.bodies < b.bodies; });
}

void rename_pair_work(const Model& model, const std::vector<Body>& before, const std::vector<Body>& now, RunRecord& record) {
  if (record.pair_work.empty()) return;
  std::map<std::string, std::uint32_t> number;
  const auto count = static_cast<std::uint32_t>(now.size() + model.fixed.size());
  for (std::uint32_t i = 0; i < count; ++i) number.emplace(body_name(model, now, i), i);
  std::vector<RunRecord::PairWork> kept;
  for (const RunRecord::PairWork& pair : record.pair_work) {
    const auto a = number.find(body_name(model, before, pair.bodies.a)), b = number.find(body_name(model, before, pair.bodies.b));
    if (a == number.end() || b == number.end()) continue;
    const auto [low, high] = std::minmax(a->second, b->second);
    kept.push_back({{low, high}, pair.work, pair.power});
  }
  std::sort(kept.begin(), kept.end(), [](const RunRecord::PairWork& a, const RunRecord::PairWork& b) { return a.bodies < b.bodies; });
  record.pair_work = std::move(kept);
}

double all_pair_work(const RunRecord& record) {
  double sum = 0.0;
  for (const RunRecord::PairWork& pair : record.pair_work) sum += pair.work;
  return sum;
}

double pair_work(const RunRecord& record, const collision::BodyPair& bodies) {
  const auto& all = record.pair_work;
  const auto at = std::lower_bound(all.begin(), all.end(), bodies, [](const RunRecord::PairWork& p, const collision::BodyPair& b) { return p.bodies < b; });
  return at != all.end() && at->bodies == bodies ? at->work : 0.0;
}

}  // namespace supple::scenes
