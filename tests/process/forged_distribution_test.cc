// Distributions that nobody can have found, before and while a trainer trains on one that somebody
// has. In real time: in the run's own a training takes no time in which anything could be heard.

#include <cmath>

#include "plumb/parameter_distribution_t.hpp"
#include "plumb/training_status_t.hpp"
#include "robot/parameter_distribution.h"
#include "tests/calibrator/sample_findings.h"
#include "tests/process/launch.h"

namespace plumb {
namespace {

struct Forgery {
  parameter_distribution_t message;
  std::string refusal;  // that the trainer is to write
};

std::vector<Forgery> Forgeries(const RobotDescription& robot) {
  const parameter_distribution_t right = ParameterDistribution::Prior(robot).ToMessage();
  const size_t n = robot.parameters.size();
  ParameterDistribution lacking = ParameterDistribution::Prior(robot);
  lacking.residual = std::make_shared<const Residual>(SampleResidual(robot));
  std::vector<Forgery> forgeries{
      {right, "the mean of 'gravity'"},
      {right, "'length/pole' is 1.41"},
      {right, "the variance of 'mass/pole'"},
      {right, "a start is beyond"},
      {lacking.ToMessage(), "the residual's draw of 'gravity'"},
      {lacking.ToMessage(), "the residual is another robot's"},  // a hopper's: it has contacts
  };
  forgeries[0].message.mean[0] = std::exp(150.);  // of its logarithm
  forgeries[1].message.mean[2] = 150;             // the length is e^150: near in its logarithm
  forgeries[2].message.covariance[n + 1] = std::exp(150.);
  forgeries[3].message.start = {0, 1e38f}, forgeries[3].message.num_starts = 2;
  forgeries[4].message.draw[0] = std::exp(150.);
  return forgeries;
}

/// Has a trainer make the first policy, and says the forgeries before, and each time that it has
/// made an update.
policy_t Train(Stage& stage, const std::vector<Forgery>& forgeries) {
  Publisher<parameter_distribution_t> distributions(stage.messenger, "PARAMETER_DISTRIBUTION");
  Subscriber<training_status_t> trainings(stage.messenger, "TRAINING_STATUS");
  Subscriber<policy_t> policies(stage.messenger, "POLICY");
  Child& trainer = stage.Start("plumb-trainer", {"--threads", "1"});
  const auto refused = [&](const Forgery& forgery) {
    const std::string log = Read(trainer.log());
    int times = 0;
    for (size_t at = 0; (at = log.find(forgery.refusal, at)) != std::string::npos; ++at) ++times;
    return times;
  };
  const auto wait = [&](const std::function<bool()>& so) {
    const bool came = stage.WaitUntil([&] { return so() || !trainer.running(); }, kLong);
    INFO(trainer.Tail(20));
    REQUIRE(trainer.running());
    REQUIRE(came);
  };
  // Its own, not the last words of a trainer that was killed, which may still be on their way.
  wait([&] { return trainings.received() > 0 && trainings.newest().update == 0; });
  for (const Forgery& forgery : forgeries) {
    INFO(forgery.refusal);
    distributions.Publish(forgery.message);
    wait([&] { return refused(forgery) == 1; });
  }
  CHECK(trainings.newest().update == 0);
  distributions.Publish(ParameterDistribution::Prior(stage.robot).ToMessage());
  int update = 0;
  wait([&] {
    if (std::exchange(update, trainings.newest().update) != trainings.newest().update) {
      for (const Forgery& forgery : forgeries) distributions.Publish(forgery.message);
    }
    return policies.received() > 0 && trainings.newest().complete;
  });
  for (const Forgery& forgery : forgeries) {
    INFO(forgery.refusal);
    CHECK(refused(forgery) > 1);
  }
  stage.Kill("plumb-trainer");
  return policies.newest();
}

TEST_CASE("a trainer that hears impossible distributions names what is wrong and trains on") {
  Stage stage(66, "pendulum", Stage::Time::kReal);
  LearnLittle(stage, 20);
  const policy_t undisturbed = Train(stage, {}), policy = Train(stage, Forgeries(stage.robot));
  CHECK(policy.weight == undisturbed.weight);
  CHECK(policy.iteration == 0);
}

}  // namespace
}  // namespace plumb
