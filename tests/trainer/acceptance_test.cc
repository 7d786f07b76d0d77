#include "trainer/acceptance.h"

#include <catch2/catch.hpp>
#include <cmath>

namespace plumb {
namespace {

Trial Hops(int steps, double rate, bool fell) {
  Trial trial;
  for (int i = 0; i < steps; ++i) trial.Add(rate, 500);
  trial.fell = fell;
  return trial;
}

}  // namespace

TEST_CASE("a trial knows its sum and the rate of its second half") {
  Trial trial;
  for (int i = 0; i < 8; ++i) trial.Add(i < 4 ? 1 : 3 + i % 2, 8);
  CHECK(trial.steps == 8);
  CHECK(trial.sum_of_rewards == 18);
  CHECK(trial.late_rate == Approx(3.5));
  CHECK(trial.WholeReturn(20) == Approx(18 + 12 * 3.5));
  trial.fell = true;
  CHECK(trial.WholeReturn(20) == 18);
}

TEST_CASE("where nobody falls a return is the rate times the steps") {
  Acceptance acceptance(1000);
  acceptance.Add(0, Hops(500, 3, false));
  CHECK(acceptance.incumbent() == 0);
  CHECK(acceptance.MeanReturn(0) == Approx(3000).epsilon(0.005));
}

TEST_CASE("a hazard shortens what an episode would have been") {
  Acceptance acceptance(1000);
  acceptance.Add(0, Hops(250, 3, true));
  acceptance.Add(1, Hops(500, 3, false));
  CHECK(acceptance.MeanReturn(0) == Approx(750).epsilon(0.005));  // it has fallen: that is all
  // Falls of both: 1 in 750 steps; of policy 1 lambda ~ Gamma(1, 750 + 500), hence over 500 steps
  //   E (1 - e^(-500 lambda)) / lambda = integral over m < 500 of 1250 / (1250 + m)
  const double expected = 1500 + 3 * 1250 * std::log(1750. / 1250);
  CHECK(acceptance.MeanReturn(1) == Approx(expected).epsilon(0.01));
}

TEST_CASE("who falls does not replace who does not, and the other way round") {
  Acceptance acceptance(1000);
  acceptance.Add(0, Hops(500, 3, false));
  acceptance.Add(1, Hops(200, 3.3, true));
  const auto worse = acceptance.Decide(1, 0, {});
  CHECK_FALSE(worse.accepted);
  CHECK(worse.probability < 0.02);
  CHECK(acceptance.incumbent() == 0);

  Acceptance other(1000);
  other.Add(0, Hops(200, 3.3, true));
  other.Add(1, Hops(500, 3, false));
  const auto better = other.Decide(1, 0, {});
  CHECK(better.accepted);
  CHECK(better.probability > 0.98);
  CHECK(better.incumbent == 0);
  CHECK(other.incumbent() == 1);
  CHECK(Summary(better).find("policy 1 accepted") == 0);
}

TEST_CASE("equals do not replace each other") {
  Acceptance acceptance(1000);
  acceptance.Add(1, Hops(500, 3, false));
  acceptance.Add(2, Hops(500, 3, false));
  const auto decision = acceptance.Decide(2, 0, {});
  CHECK(decision.probability == Approx(0.5).margin(0.03));
  CHECK_FALSE(decision.accepted);
  // 0.8 of 100 apart, each with 0.8 of 100 of scatter: Phi(1 / sqrt 2) = 0.76
  acceptance.Add(3, Hops(500, 3.024, false));
  CHECK(acceptance.Decide(3, 0, {}).probability == Approx(0.76).margin(0.02));
}

TEST_CASE("the first policy, which has learnt nothing of the robot, is worth 5 of 100 less") {
  Acceptance acceptance(1000);
  acceptance.Add(0, Hops(500, 3, false));
  acceptance.Add(1, Hops(500, 0.95 * 3, false));
  const auto equal = acceptance.Decide(1, 0, {});
  CHECK(equal.probability == Approx(0.5).margin(1e-9));
  CHECK(equal.incumbent_return == Approx(3000));
  acceptance.Add(2, Hops(500, 0.97 * 3, false));
  CHECK(acceptance.Decide(2, 0, {}).accepted);

  Acceptance costs(1000);
  costs.Add(0, Hops(500, -3, false));
  costs.Add(1, Hops(500, -1.05 * 3, false));
  CHECK(costs.Decide(1, 0, {}).probability == Approx(0.5).margin(1e-9));
}

TEST_CASE("the falls of one policy do not keep others from being told apart") {
  Acceptance acceptance(1000);
  acceptance.Add(0, Hops(60, 2, true));
  acceptance.Add(1, Hops(500, 3, false));
  REQUIRE(acceptance.Decide(1, 0, {}).accepted);
  acceptance.Add(2, Hops(500, 3.06, false));
  const auto decision = acceptance.Decide(2, 0, {});
  CHECK(decision.challenger_return / decision.incumbent_return == Approx(1.02));
  CHECK(decision.probability == Approx(0.96).margin(0.01));  // Phi(2 / 0.8 / sqrt 2)
  CHECK(decision.accepted);
}

TEST_CASE("who begins better has not done better") {
  Acceptance acceptance(1000);
  acceptance.Add(1, Hops(500, 3, false));
  acceptance.Add(2, Hops(500, 3.6, false));
  // 600 apart, each with 600 of scatter by where it begins: Phi(1 / sqrt 2) = 0.76
  CHECK(acceptance.Decide(2, 600, {}).probability == Approx(0.76).margin(0.005));
  // less than trials scatter by that begin alike: as if there were none
  acceptance.Add(3, Hops(500, 3.6288, false));
  Acceptance alike = acceptance;
  CHECK(acceptance.Decide(3, 1, {}).probability == alike.Decide(3, 0, {}).probability);
}

TEST_CASE("costs are returns, too") {
  Acceptance acceptance(200);
  Trial swing, fails;
  for (int i = 0; i < 100; ++i) swing.Add(i < 40 ? -3.5 : 0, 100), fails.Add(-6, 100);
  acceptance.Add(0, fails);
  acceptance.Add(1, swing);
  CHECK(acceptance.MeanReturn(0) == Approx(-1200).epsilon(0.01));
  CHECK(acceptance.MeanReturn(1) == Approx(-140).epsilon(0.01));
  CHECK(acceptance.Decide(1, 0, {}).accepted);
}

TEST_CASE("a trusted policy is taken whatever the trials say") {
  Acceptance acceptance(1000);
  acceptance.Add(0, Hops(500, 3, false));
  acceptance.Add(1, Hops(500, 2, false));
  CHECK(acceptance.Trust(1, 0).accepted);
  CHECK(acceptance.incumbent() == 1);
  CHECK_THROWS_AS(acceptance.Decide(7, 0, {}), std::invalid_argument);
  const auto untried = acceptance.Trust(7, 0);
  CHECK(untried.accepted);
  CHECK(std::isnan(untried.probability));
  CHECK(std::isnan(untried.challenger_return));
  CHECK(untried.incumbent_return == Approx(2000).epsilon(0.005));
  CHECK(acceptance.incumbent() == 7);
}

TEST_CASE("what falls in the simulator that was learnt since does not replace what does not") {
  const auto decide = [](const Acceptance::Simulated& simulated) {
    Acceptance acceptance(1000);
    acceptance.Add(1, Hops(500, 3, false));
    acceptance.Add(2, Hops(500, 3.3, false));
    return acceptance.Decide(2, 0, simulated);
  };
  CHECK(decide({2900, 3000}).accepted);
  CHECK(decide({NAN, NAN}).accepted);
  const Acceptance::Decision refused = decide({1400, 1900});
  CHECK_FALSE(refused.accepted);
  CHECK(refused.less_simulated);
  CHECK(refused.probability > 0.99);
  CHECK(decide({-104, -100}).accepted);
  CHECK_FALSE(decide({-106, -100}).accepted);

  Acceptance acceptance(1000);
  acceptance.Add(1, Hops(500, 3, false));
  acceptance.Add(2, Hops(500, 2.7, false));
  CHECK_FALSE(acceptance.Decide(2, 0, {1400, 1900}).less_simulated);  // nor on the robot
}

TEST_CASE("a decision says who, why and how sure") {
  CHECK(Summary({3, 2, true, false, 0.98, false, 2951, 1846}) ==
        "policy 3 accepted (2951; incumbent 2: 1846; better with 98 %)");
  CHECK(Summary({3, 0, false, false, 0.1, false, 846, 1846}) ==
        "policy 3 not accepted (846; incumbent 0: 1846 less 5 %; better with 10 %)");
  CHECK(Summary({3, 2, true, true, 0.5, false, 1850, 1846}) ==
        "policy 3 trusted: trained without a residual (1850; incumbent 2: 1846; better with 50 "
        "%)");
  CHECK(Summary({3, 2, true, true, NAN, false, NAN, 1846}) ==
        "policy 3 trusted: trained without a residual");
  CHECK(Summary({3, 2, false, false, 0.98, true, 2951, 1846}) ==
        "policy 3 not accepted (2951; incumbent 2: 1846; better with 98 %, but not in the "
        "simulator that was learnt since)");
  CHECK(Summary({0, 0, false, false, 0, false, 1846, 1846}) == "policy 0 is the first (1846)");
}

TEST_CASE("who goes on where another stood decides alike") {
  Acceptance straight(1000);
  straight.Add(0, Hops(500, 3, false));
  straight.Add(1, Hops(500, 3.2, false));
  straight.Decide(1, 0, {});
  straight.Add(2, Hops(300, 3.3, true));
  Acceptance resumed(1000, straight.trials(), straight.incumbent());
  const auto expected = straight.Decide(2, 0, {}), decision = resumed.Decide(2, 0, {});
  CHECK(decision.incumbent == expected.incumbent);
  CHECK(decision.probability == expected.probability);
  CHECK(decision.challenger_return == expected.challenger_return);
}

}  // namespace plumb
