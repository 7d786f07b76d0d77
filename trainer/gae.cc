#include "trainer/gae.h"

#include <cmath>
#include <numeric>

namespace plumb {

Advantages EstimateAdvantages(std::span<const double> rewards, std::span<const double> values,
                              std::span<const EpisodeSpan> episodes,
                              std::span<const double> final_values, double gamma, double lambda) {
  Advantages result{std::vector<double>(rewards.size()), std::vector<double>(rewards.size())};
  for (size_t e = 0; e < episodes.size(); ++e) {
    const EpisodeSpan& episode = episodes[e];
    double next_value = episode.terminated ? 0 : final_values[e];
    double advantage = 0;
    for (int i = episode.end; i-- > episode.begin;) {
      const auto t = static_cast<size_t>(i);
      const double difference = rewards[t] + gamma * next_value - values[t];
      advantage = difference + gamma * lambda * advantage;
      result.advantage[t] = advantage;
      result.target[t] = advantage + values[t];
      next_value = values[t];
    }
  }
  return result;
}

void Normalize(std::span<double> advantages) {
  const auto count = static_cast<double>(advantages.size());
  const double mean = std::accumulate(advantages.begin(), advantages.end(), 0.) / count;
  double squares = 0;
  for (double& a : advantages) {
    a -= mean;
    squares += a * a;
  }
  const double sd = std::sqrt(squares / count);
  // Equal numbers differ by rounding, and that is no difference.
  const bool differ = sd > 1e-12 * std::abs(mean) && sd > 0;
  for (double& a : advantages) a = differ ? a / sd : 0;
}

}  // namespace plumb
