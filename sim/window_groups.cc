#include "sim/window_groups.h"

#include <algorithm>
#include <map>
#include <numeric>
#include <stdexcept>
#include <utility>

namespace plumb {
namespace {

// Of a window: 80 MB of efforts for six joints.
constexpr double kMaxWindowSubsteps = 1e5;

void Require(const Window& window, const Model& model) {
  const auto sized = [&](std::span<const EffortSegment> segments) {
    return std::all_of(segments.begin(), segments.end(), [&](const EffortSegment& segment) {
      return segment.effort.size() == model.num_velocities();
    });
  };
  bool good = window.q.size() == model.num_positions() &&
              window.v.size() == model.num_velocities() && window.q.allFinite() &&
              window.v.allFinite() && !window.steps.empty();
  for (const auto& step : window.before) good = good && sized(step);
  double substeps = 0;
  for (const auto& step : window.steps) {
    const double duration = Duration(step);
    good = good && sized(step) && duration > 0;
    substeps += SubstepCount(duration, model.description().simulation.substep);
  }
  if (!good) {
    throw std::invalid_argument(
        "a window needs a finite state, and steps of some duration with efforts for all joints");
  }
  if (!(substeps <= kMaxWindowSubsteps))
    throw std::invalid_argument("a window is too long to be simulated");
}

}  // namespace

double Duration(std::span<const EffortSegment> step) {
  return std::accumulate(step.begin(), step.end(), 0.0,
                         [](double sum, const EffortSegment& segment) {
                           return sum + std::max(0.0, segment.duration);
                         });
}

std::vector<WindowGroup> GroupWindows(std::span<const Window> windows, const Model& model,
                                      size_t lanes) {
  std::map<std::vector<int>, std::vector<size_t>> kinds;
  for (size_t i = 0; i < windows.size(); ++i) {
    Require(windows[i], model);
    std::vector<int> counts;
    for (const auto& step : windows[i].steps) {
      counts.push_back(
          static_cast<int>(SubstepCount(Duration(step), model.description().simulation.substep)));
    }
    kinds[counts].push_back(i);
  }
  std::vector<WindowGroup> groups;
  for (const auto& [counts, members] : kinds) {
    for (size_t begin = 0; begin < members.size(); begin += lanes) {
      WindowGroup group;
      group.counts = counts;
      group.used = std::min(lanes, members.size() - begin);
      for (size_t lane = 0; lane < lanes; ++lane) {
        group.windows.push_back(members[begin + std::min(lane, group.used - 1)]);
      }
      groups.push_back(std::move(group));
    }
  }
  return groups;
}

}  // namespace plumb
