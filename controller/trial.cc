#include "controller/trial.h"

namespace plumb {

void Trial::Add(double reward, int planned) {
  sum_of_rewards += reward;
  ++steps;
  const int late = steps - planned / 2;
  if (late > 0) late_rate += (reward - late_rate) / late;
}

double Trial::WholeReturn(int episode_steps) const {
  return sum_of_rewards + (fell ? 0 : late_rate * (episode_steps - steps));
}

}  // namespace plumb
