#include "fit/balls.h"

#include <algorithm>
#include <iterator>
#include <numeric>
#include <queue>

namespace supple::fit {
namespace {

constexpr std::size_t kBlock = 256;

double touching_radius(const SurfaceSamples& surface, const PointTree& tree, std::size_t k, double side, double most, double slack) {
  const Vec3& p = surface.position[k];
  const Vec3 inward = side * surface.normal[k];
  double radius = most;
  constexpr int kMostSteps = 40;
  for (int step = 0; step < kMostSteps; ++step) {
    const Vec3 centre = p + radius * inward;
    const std::uint32_t deepest = tree.nearest(centre, radius - slack);
    if (deepest == PointTree::kNone) break;
    const Vec3 toward = surface.position[deepest] - p;
    const double smaller = toward.squaredNorm() / (2.0 * toward.dot(inward));  // > 0, as the point is inside the ball
    if (!(smaller < radius)) break;
    radius = smaller;
  }
  return radius;
}

}  // namespace

std::vector<double> touching_radii(const SurfaceSamples& surface, const PointTree& tree, double side, double most, double slack, const Executor& executor) {
  std::vector<double> out(surface.position.size());
  executor.for_blocks(out.size(), kBlock, [&](std::size_t begin, std::size_t end) {
    for (std::size_t k = begin; k < end; ++k) out[k] = touching_radius(surface, tree, k, side, most, slack);
  });
  return out;
}

std::vector<Ball> cover_surface(const SurfaceSamples& surface, const PointTree& tree, std::span<const double> radius, std::span<const std::uint32_t> wanted, double reach) {
  const std::size_t n = surface.position.size();
  std::vector<char> open(n, 0);
  for (const std::uint32_t k : wanted) open[k] = 1;
  const auto ball_at = [&](std::uint32_t k) { return Ball{surface.position[k] - radius[k] * surface.normal[k], radius[k]}; };
  std::vector<std::uint32_t> near;
  const auto gain = [&](std::uint32_t k) {
    const Ball ball = ball_at(k);
    tree.within(ball.centre, ball.radius + reach, near);
    return std::count_if(near.begin(), near.end(), [&](std::uint32_t s) { return open[s] != 0; });
  };
  // Gains only fall, so one that is still the largest when it is counted anew is the largest of all.
  using Entry = std::pair<std::ptrdiff_t, std::int64_t>;  // gain, minus the sample
  std::priority_queue<Entry> queue;
  constexpr std::size_t kOffered = 4;  // balls at each of so many samples: those between differ little
  for (std::size_t k = 0; k < wanted.size(); k += kOffered) queue.emplace(gain(wanted[k]), -std::int64_t{wanted[k]});
  std::vector<Ball> out;
  while (!queue.empty()) {
    const auto k = static_cast<std::uint32_t>(-queue.top().second);
    queue.pop();
    const std::ptrdiff_t now = gain(k);
    if (now == 0) continue;
    if (!queue.empty() && Entry(now, -std::int64_t{k}) < queue.top()) {
      queue.emplace(now, -std::int64_t{k});
      continue;
    }
    out.push_back(ball_at(k));
    for (const std::uint32_t s : near) open[s] = 0;
  }
  // What these do not reach, by balls of its own, the largest first.
  std::vector<std::uint32_t> rest;
  std::copy_if(wanted.begin(), wanted.end(), std::back_inserter(rest), [&](std::uint32_t k) { return open[k] != 0; });
  std::stable_sort(rest.begin(), rest.end(), [&](std::uint32_t a, std::uint32_t b) { return radius[a] > radius[b]; });
  for (const std::uint32_t k : rest) {
    if (open[k] == 0) continue;
    out.push_back(ball_at(k));
    (void)gain(k);
    for (const std::uint32_t s : near) open[s] = 0;
  }
  return out;
}

void cover_inside(const Surroundings& around, double most, std::vector<Ball>& balls) {
  if (around.inside.empty()) return;
  const PointTree tree(around.inside);
  std::vector<char> open(around.inside.size(), 1);
  std::vector<std::uint32_t> near;
  const auto close = [&](const Ball& ball) {
    constexpr double kCovered = 0.9;  // of the radius of small balls; of large ones what lies half a step inside
    tree.within(ball.centre, std::max(kCovered * ball.radius, ball.radius - 0.5 * around.step), near);
    for (const std::uint32_t k : near) open[k] = 0;
  };
  for (const Ball& ball : balls) close(ball);
  std::vector<std::uint32_t> order(around.inside.size());
  std::iota(order.begin(), order.end(), 0U);
  std::stable_sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) { return around.depth[a] > around.depth[b]; });
  for (const std::uint32_t k : order) {
    if (open[k] == 0 || around.depth[k] < around.step) continue;
    balls.push_back({around.inside[k], std::min(around.depth[k], most)});
    close(balls.back());
  }
}

}  // namespace supple::fit
