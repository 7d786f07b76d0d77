#include "controller/trial.h"

#include <algorithm>

namespace plumb {

Trial Trial::Stopped(int steps, double sum_of_rewards) {
  const double rate = std::min(0., sum_of_rewards / std::max(1, steps));
  return {steps, sum_of_rewards, rate, rate == 0};
}

void Trial::Add(double reward, int planned) {
  sum_of_rewards += reward;
  ++steps;
  const int late = steps - planned / 2;
  if (late > 0) late_rate += (reward - late_rate) / late;
}

double Trial::Continuation(double further_steps) const {
  return fell ? 0 : late_rate * further_steps;
}

}  // namespace plumb
