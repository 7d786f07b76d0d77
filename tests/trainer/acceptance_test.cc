#include "trainer/acceptance.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <vector>

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

TEST_CASE("an episode that was stopped earns nothing more, and goes on to pay") {
  CHECK(Trial::Stopped(5, 15).WholeReturn(200) == 15);
  CHECK(Trial::Stopped(5, 15).fell);
  CHECK(Trial::Stopped(5, -30).WholeReturn(200) == Approx(-1200));
  CHECK_FALSE(Trial::Stopped(5, -30).fell);
  CHECK(Trial::Stopped(0, 0).WholeReturn(200) == 0);
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
  const auto worse = acceptance.Decide(1, {}, {});
  CHECK_FALSE(worse.accepted);
  CHECK(worse.probability < 0.02);
  CHECK(acceptance.incumbent() == 0);

  Acceptance other(1000);
  other.Add(0, Hops(200, 3.3, true));
  other.Add(1, Hops(500, 3, false));
  const auto better = other.Decide(1, {}, {});
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
  const auto decision = acceptance.Decide(2, {}, {});
  CHECK(decision.probability == Approx(0.5).margin(0.03));
  CHECK_FALSE(decision.accepted);
  // 0.8 of 100 apart, each with 0.8 of 100 of scatter: Phi(1 / sqrt 2) = 0.76
  acceptance.Add(3, Hops(500, 3.024, false));
  CHECK(acceptance.Decide(3, {}, {}).probability == Approx(0.76).margin(0.02));
}

TEST_CASE("the falls of one policy do not keep others from being told apart") {
  Acceptance acceptance(1000);
  acceptance.Add(0, Hops(60, 2, true));
  acceptance.Add(1, Hops(500, 3, false));
  REQUIRE(acceptance.Decide(1, {}, {}).accepted);
  acceptance.Add(2, Hops(500, 3.06, false));
  const auto decision = acceptance.Decide(2, {}, {});
  CHECK(decision.challenger_return / decision.incumbent_return == Approx(1.02));
  CHECK(decision.probability == Approx(0.96).margin(0.01));  // Phi(2 / 0.8 / sqrt 2)
  CHECK(decision.accepted);
}

TEST_CASE("who begins better has not done better") {
  Acceptance acceptance(1000);
  acceptance.Add(1, Hops(500, 3, false));
  acceptance.Add(2, Hops(500, 3.6, false));
  // 600 apart, each with 600 of scatter by where it begins: Phi(1 / sqrt 2) = 0.76
  CHECK(acceptance.Decide(2, {3000, 0, 600}, {NAN, NAN}).probability == Approx(0.76).margin(0.005));
  // less than trials scatter by that begin alike: as if there were none
  acceptance.Add(3, Hops(500, 3.6288, false));
  Acceptance alike = acceptance;
  CHECK(acceptance.Decide(3, {3000, 0, 1}, {}).probability == alike.Decide(3, {}, {}).probability);
}

TEST_CASE("costs are returns, too") {
  Acceptance acceptance(200);
  Trial swing, fails;
  for (int i = 0; i < 100; ++i) swing.Add(i < 40 ? -3.5 : 0, 100), fails.Add(-6, 100);
  acceptance.Add(0, fails);
  acceptance.Add(1, swing);
  CHECK(acceptance.MeanReturn(0) == Approx(-1200).epsilon(0.01));
  CHECK(acceptance.MeanReturn(1) == Approx(-140).epsilon(0.01));
  CHECK(acceptance.Decide(1, {}, {}).accepted);
}

TEST_CASE("a trusted policy is taken whatever the trials say") {
  Acceptance acceptance(1000);
  acceptance.Add(0, Hops(500, 3, false));
  acceptance.Add(1, Hops(500, 2, false));
  CHECK(acceptance.Trust(1, {}).accepted);
  CHECK(acceptance.incumbent() == 1);
  CHECK_THROWS_AS(acceptance.Decide(7, {}, {}), std::invalid_argument);
  const auto untried = acceptance.Trust(7, {});
  CHECK(untried.accepted);
  CHECK(std::isnan(untried.probability));
  CHECK(std::isnan(untried.challenger_return));
  CHECK(untried.incumbent_return == Approx(2000).epsilon(0.005));
  CHECK(acceptance.incumbent() == 7);
}

TEST_CASE("half of a difference in simulation counts") {
  const auto probability = [](const Acceptance::Simulated& simulated) {
    Acceptance acceptance(1000);
    acceptance.Add(1, Hops(500, 3, false));
    acceptance.Add(2, Hops(500, 3.3, false));
    return acceptance.Decide(2, {}, simulated).probability;
  };
  CHECK(probability({2000, 2600}) == Approx(0.5));  // 300 more on the robot
  CHECK(probability({1400, 2200}) < 0.05);
  // 300 apart, each with 0.8 of 100 of scatter
  const double alike = std::erfc(-300 / std::hypot(24, 26.4) / std::sqrt(2.0)) / 2;
  CHECK(probability({2000, 2000}) == Approx(alike));
  CHECK(probability({NAN, 2000}) == Approx(alike));
  CHECK(probability({NAN, NAN}) == Approx(alike));
}

TEST_CASE("where beginnings decide, trials and simulators count by how precise they are") {
  const auto probability = [](double scatter, const Acceptance::Simulated& simulated) {
    Acceptance acceptance(1000);
    acceptance.Add(1, Hops(500, 3, false));
    acceptance.Add(2, Hops(500, 3.3, false));
    return acceptance.Decide(2, {3300, scatter}, simulated).probability;
  };
  const auto normal = [](double mean, double sd) {
    return std::erfc(-mean / sd / std::sqrt(2.0)) / 2;
  };
  // 300 more in trials that scatter by 400 each, 100 less in simulators, half of which is doubt;
  // precisions 1 / 320000 and 1 / (2500 + 900)
  const double trials = 2 * 400. * 400, simulators = 50. * 50 + 30. * 30;
  const double mean = (300 / trials - 100 / simulators) / (1 / trials + 1 / simulators);
  const double sd = std::sqrt(1 / (1 / trials + 1 / simulators));
  CHECK(probability(400, {2000, 2100, 30}) == Approx(normal(mean, sd)));
  CHECK(probability(400, {2000, 2100, 30}) < 0.06);
  // Simulators that have not told the policies apart leave it to the trials.
  CHECK(probability(400, {2000, 1999.9, 1e5}) ==
        Approx(normal(300, std::sqrt(trials))).margin(1e-4));
  CHECK(probability(400, {2000, 2000, 0}) == 0.5);
  CHECK(probability(400, {NAN, NAN, NAN}) == Approx(normal(300, std::sqrt(trials))));
  // A tenth of 3300 is where beginnings begin to decide. There the two are 600 apart, which the
  // trials' scatter of 468 and the simulators' doubt of 150 do not explain.
  const double exact = 2 * 331. * 331, doubtful = 600. * 600 - exact;
  const double both = (300 / exact - 300 / doubtful) / (1 / exact + 1 / doubtful);
  CHECK(probability(331, {2000, 2300, 0}) ==
        Approx(normal(both, 1 / std::sqrt(1 / exact + 1 / doubtful))));
  CHECK(probability(329, {2000, 2600, 0}) == Approx(0.5));
}

TEST_CASE("a trial that is bad beyond chance is not outweighed by simulators that see little") {
  // costs: -150 in the incumbent's trial, and 120 by which trials scatter
  const auto probability = [](double cost, int trials) {
    Acceptance acceptance(1);
    acceptance.Add(1, {1, -150, -150, false});
    for (int i = 0; i < trials; ++i) acceptance.Add(2, {1, -cost, -cost, false});
    return acceptance.Decide(2, {-150, 120}, {-148, -150, 1.3}).probability;
  };
  CHECK(probability(250, 1) > Acceptance::kSure);
  double before = 1;
  for (const double cost : {250, 400, 600, 1000, 1600}) {
    CHECK(probability(cost, 1) <= before);
    before = probability(cost, 1);
  }
  CHECK(probability(600, 1) < 0.25);
  CHECK(probability(600, 10) < probability(600, 1));
}

TEST_CASE("what policies return in the same simulators tells them apart by its difference") {
  const std::vector<double> challenger{10, 22, 30, NAN, 50}, incumbent{9, 20, 27, 38, NAN};
  const auto simulated = Acceptance::Simulated::Of(challenger, incumbent);
  CHECK(simulated.challenger == Approx(62 / 3.));  // where neither failed
  CHECK(simulated.incumbent == Approx(56 / 3.));
  CHECK(simulated.difference_sd == Approx(1 / std::sqrt(3.)));  // of 1, 2 and 3
  const auto never =
      Acceptance::Simulated::Of(std::vector<double>{NAN, 1}, std::vector<double>{1, NAN});
  CHECK(std::isnan(never.challenger));
  CHECK_THROWS_AS(Acceptance::Simulated::Of(challenger, std::vector<double>{1}),
                  std::invalid_argument);
}

TEST_CASE("a decision says who, why and how sure") {
  CHECK(Summary({3, 2, true, false, 0.98, 2951, 1846, {NAN, NAN}}) ==
        "policy 3 accepted (2951; incumbent 2: 1846; better with 98 %)");
  CHECK(Summary({3, 0, false, false, 0.1, 846, 1846, {NAN, NAN}}) ==
        "policy 3 not accepted (846; incumbent 0: 1846; better with 10 %)");
  CHECK(Summary({3, 2, true, true, 0.5, 1850, 1846, {NAN, NAN}}) ==
        "policy 3 trusted: the model explains the robot (1850; incumbent 2: 1846; better with 50 "
        "%)");
  CHECK(Summary({3, 2, true, true, NAN, NAN, 1846, {NAN, NAN}}) ==
        "policy 3 trusted: the model explains the robot");
  CHECK(Summary({3, 2, false, false, 0.1, 2951, 2846, {1400, 1900}}) ==
        "policy 3 not accepted (2951; incumbent 2: 2846; simulated 1400, 1900; better with 10 %)");
  CHECK(Summary({0, 0, false, false, 0, 1846, 1846, {NAN, NAN}}) == "policy 0 is the first (1846)");
}

TEST_CASE("who goes on where another stood decides alike") {
  Acceptance straight(1000);
  straight.Add(0, Hops(500, 3, false));
  straight.Add(1, Hops(500, 3.2, false));
  straight.Decide(1, {}, {});
  straight.Add(2, Hops(300, 3.3, true));
  Acceptance resumed(1000, straight.trials(), straight.incumbent());
  const auto expected = straight.Decide(2, {}, {}), decision = resumed.Decide(2, {}, {});
  CHECK(decision.incumbent == expected.incumbent);
  CHECK(decision.probability == expected.probability);
  CHECK(decision.challenger_return == expected.challenger_return);
}

}  // namespace plumb
