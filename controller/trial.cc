#include "controller/trial.h"

namespace plumb {

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
