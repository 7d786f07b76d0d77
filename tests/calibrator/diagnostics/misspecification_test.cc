#include "calibrator/diagnostics/misspecification.h"

#include <fmt/format.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <chrono>
#include <cmath>
#include <iostream>
#include <limits>
#include <map>

#include "calibrator/diagnostics/error_tests.h"
#include "calibrator/diagnostics/projected_errors.h"
#include "common/gaussian.h"
#include "sim/touch.h"
#include "tests/calibrator/fitted_log.h"

namespace plumb {
namespace {

struct Wrong {
  const char* name;
  Truth truth;
};

/// Errors of the model that the hopper's masses, the only parameters fitted, cannot absorb.
std::vector<Wrong> WrongModels() {
  return {{"inertia/torso", {{{"inertia/torso", 1.2}}}},
          {"inertia/thigh", {{{"inertia/thigh", 1.2}}}},
          {"inertia/leg", {{{"inertia/leg", 1.2}}}},
          {"inertia/foot", {{{"inertia/foot", 1.2}}}},
          {"friction/leg", {{{"friction/leg", 5}}}},
          {"delay/thigh", {{{"delay/thigh", 0.002}}}},
          {"gravity", {{{"gravity", 9.81 * 1.02}}}},
          {"contact/stiffness", {{{"contact/stiffness", 7500}}}}};
}

Misspecification Diagnose(const RobotDescription& robot, const Truth& truth, int transitions,
                          uint64_t seed) {
  return FittedLog(robot, RandomLog(robot, truth, transitions, seed)).Find();
}

}  // namespace

TEST_CASE("what a model gets wrong is named, and a right model is left in peace") {
  const RobotDescription robot = Robot("hopper");
  const Misspecification right = Diagnose(robot, {}, 400, 7);
  INFO(right.summary);
  CHECK_FALSE(right.alarm);
  CHECK(right.misfits.empty());
  for (const Wrong& wrong : WrongModels()) {
    const Misspecification found = Diagnose(robot, wrong.truth, 400, 7);
    INFO(wrong.name << ": " << found.summary);
    CHECK(found.alarm);
    CHECK_THAT(found.summary, Catch::StartsWith("the model cannot explain this log: "));
    REQUIRE(!found.misfits.empty());
    CHECK_THAT(found.misfits[0].what, Catch::StartsWith(wrong.name));
    CHECK(found.misfits[0].test == "structure");
    CHECK(found.misfits[0].p < kFalseAlarm);
    CHECK(found.misfits[0].effect > kLeastShare);
    if (std::string(wrong.name) != "contact/stiffness") continue;
    for (const Misfit& misfit : found.misfits) CHECK(misfit.condition != "free");
    CHECK(found.misfits[0].condition == "contact");
  }
}

TEST_CASE("what rests has no errors to compare, in contact or out of it") {
  const RobotDescription robot = Robot("hopper");
  FittedLog log(robot, RandomLog(robot, {}, 250, 3));
  log.residuals.rollouts = log.rollouts;
  log.residuals.rows = log.rows;
  log.residuals.noise_known.assign(12, false);
  for (size_t i = 0; i < log.rows.size(); ++i) {
    if (log.rows[i].coordinate != 5) continue;
    log.residuals.errors(static_cast<Eigen::Index>(i)) = 0;
    log.residuals.jacobian.row(static_cast<Eigen::Index>(i)).setZero();
  }
  const ProjectedErrors errors(log.known, log.residuals);
  REQUIRE(errors.conditions);
  const std::vector<Misfit> tests = TestScale(errors, log.residuals.noise_known);
  CHECK(tests.size() == 11);
  for (const Misfit& test : tests) CHECK(std::isfinite(test.p));
}

TEST_CASE("how much larger a parameter would have to be is told") {
  const Misspecification found = Diagnose(Robot("hopper"), {{{"inertia/torso", 1.2}}}, 400, 8);
  INFO(found.summary);
  CHECK_THAT(found.summary,
             Catch::Matches(".*inertia/torso (19|20|21) % larger would explain [0-9]+ % of it.*"));
  const Misspecification slow = Diagnose(Robot("hopper"), {{{"delay/thigh", 0.002}}}, 400, 8);
  INFO(slow.summary);
  CHECK_THAT(slow.summary, Catch::Matches(".*delay/thigh 0.002[0-9]* s larger would explain.*"));
}

TEST_CASE(
    "p values are uniform where the model is right, and a little larger at most where states are "
    "shared") {
  const RobotDescription robot = Robot("hopper");
  for (const bool shared : {false, true}) {
    const Truth truth{{}, shared ? 1e-3 : 0, 1e-3};
    FittedLog log(robot, RandomLog(robot, truth, 250, 3));
    log.residuals.rollouts = log.rollouts;
    log.residuals.rows = log.rows;
    std::map<std::string, std::vector<double>> p;
    Random random(5, {shared});
    const auto n = static_cast<Eigen::Index>(log.rows.size()),
               width = static_cast<Eigen::Index>(12);
    for (int trial = 0; trial < 40; ++trial) {
      // Of a state that two transitions share each coordinate's error appears in both: -1/2 of the
      // variance.
      const Eigen::MatrixXd noise = StandardNormals(n + width, 1, random);
      log.residuals.errors = shared
                                 ? ((noise.topRows(n) - noise.bottomRows(n)) / std::sqrt(2)).eval()
                                 : noise.topRows(n).eval();
      log.residuals.jacobian = StandardNormals(n, 4, random);
      for (const bool known : {true, false}) {
        log.residuals.noise_known.assign(12, known);
        const ProjectedErrors errors(log.known, log.residuals);
        REQUIRE(errors.conditions);
        for (const Misfit& test : TestScale(errors, log.residuals.noise_known)) {
          p[known ? "scale" : "heteroscedasticity"].push_back(test.p);
        }
        for (const auto& tests :
             {TestWhiteness(errors), TestBias(errors), TestRegression(errors)}) {
          for (const Misfit& test : tests) p[test.test].push_back(test.p);
        }
        const Eigen::VectorXd column = errors.Project(StandardNormals(n, 1, random));
        p["score"].push_back(FindScore(errors, column, 1e9, -1e9).p);
        for (const Misfit& test : TestOutliers(errors)) CHECK(test.p > 1e-4);
      }
    }
    for (const auto& [test, values] : p) {
      if (shared && (test == "scale" || test == "heteroscedasticity"))
        continue;  // rows correlate: not these tests' matter
      const auto below = [&](double limit) {
        return static_cast<double>(std::count_if(values.begin(), values.end(),
                                                 [&](double x) { return x < limit; })) /
               static_cast<double>(values.size());
      };
      INFO(test << (shared ? ", shared states" : "") << ", " << values.size()
                << " values: " << below(0.1) << ", " << below(0.5));
      CHECK(below(0.1) < 0.17);
      if (shared) continue;
      CHECK(below(0.1) > 0.03);
      CHECK(below(0.5) > 0.35);
      CHECK(below(0.5) < 0.63);
    }
  }
}

/// A right model's log whose errors a test can spoil.
class Spoilt {
 public:
  /// @param spoil is given each error, its coordinate (0 ... 11), the step's number and whether it
  /// is in contact.
  template <class Spoil>
  Misspecification Find(bool noise_known, const Spoil& spoil) {
    Random random(2);
    FittedLog log = Right();
    log.residuals.noise_known.assign(12, noise_known);
    for (size_t i = 0; i < log.rows.size(); ++i) {
      const WindowErrors::Row& row = log.rows[i];
      const Transition& t = log.rollouts[static_cast<size_t>(row.rollout)]
                                .transitions[static_cast<size_t>(row.transition)];
      double& error = log.residuals.errors(static_cast<Eigen::Index>(i));
      error = spoil(error, row.coordinate, row.window,
                    TouchFinder(log.known).OfStep(t.q, t.next_q).any(), random);
    }
    return log.Find();
  }

  static const FittedLog& Right() {
    static const RobotDescription hopper = Robot("hopper/gym.toml");
    static const FittedLog log(hopper, RandomLog(hopper, {}, 600, 11));
    return log;
  }
};

TEST_CASE_METHOD(Spoilt, "each way of being wrong has its test") {
  const auto has = [](const Misspecification& found, const std::string& test,
                      const std::string& joint, const std::string& condition) {
    return std::any_of(found.misfits.begin(), found.misfits.end(), [&](const Misfit& m) {
      return m.test == test && m.joint == joint && m.condition == condition;
    });
  };
  SECTION("nothing wrong") {
    for (const bool known : {true, false}) {
      const auto found = Find(known, [](double e, auto...) { return e; });
      INFO(found.summary);
      CHECK_FALSE(found.alarm);
      CHECK(found.misfits.empty());
    }
  }
  SECTION("scale") {
    const auto found =
        Find(true, [](double e, int c, auto...) { return c % 6 == 4 ? 1.7 * e : e; });
    INFO(found.summary);
    CHECK(found.alarm);
    CHECK(has(found, "scale", "leg", "free"));
    CHECK_FALSE(has(found, "scale", "thigh", "free"));
    // Noise that was estimated has any scale.
    CHECK_FALSE(
        Find(false, [](double e, int c, auto...) { return c % 6 == 4 ? 1.7 * e : e; }).alarm);
  }
  SECTION("larger errors in contact than in free motion, with noise estimated") {
    const auto found = Find(false, [](double e, int c, int, bool contact, auto&) {
      return c == 3 && contact ? 2 * e : e;
    });
    INFO(found.summary);
    CHECK(found.alarm);
    CHECK(has(found, "scale", "thigh", "contact"));
    CHECK(found.summary.find("position of thigh") != std::string::npos);
  }
  SECTION("bias") {
    const auto found = Find(true, [](double e, int c, auto...) { return c == 11 ? e + 0.5 : e; });
    INFO(found.summary);
    CHECK(found.alarm);
    CHECK((has(found, "bias", "foot", "free") || has(found, "bias", "foot", "contact") ||
           found.misfits[0].joint == "foot"));
  }
  SECTION("whiteness") {
    double last = 0;
    const auto found = Find(
        true, [&](double e, int c, auto...) { return c == 10 ? last = 0.6 * last + 0.8 * e : e; });
    INFO(found.summary);
    CHECK(found.alarm);
    CHECK(has(found, "whiteness", "leg", ""));
  }
  SECTION("an effect that is real but negligible") {
    CHECK_FALSE(Find(true, [](double e, auto...) { return 1.05 * e; }).alarm);
  }
  SECTION("knocks: told of, no alarm, and they pass for nothing else") {
    const auto found = Find(true, [](double e, int c, int step, auto...) {
      return c == 9 && step % 200 == 17 ? e + 100 : e;
    });
    INFO(found.summary);
    CHECK_FALSE(found.alarm);
    REQUIRE(!found.misfits.empty());
    for (const Misfit& misfit : found.misfits) {
      CHECK(misfit.test == "outliers");
      CHECK(misfit.joint == "thigh");
    }
    CHECK_THAT(found.summary, Catch::Contains("outliers"));
  }
  SECTION("heavy tails") {
    const auto found = Find(true, [](double e, int c, int, bool, Random& random) {
      return c == 9 && random.Uniform() < 0.1 ? 20 * e : e;
    });
    INFO(found.summary);
    CHECK(found.alarm);
    CHECK((has(found, "outliers", "thigh", "free") || has(found, "outliers", "thigh", "contact")));
  }
  SECTION("dependence on the state that no candidate has") {
    FittedLog log = Right();
    log.residuals.candidates.clear();
    log.residuals.columns.resize(log.residuals.errors.size(), 0);
    for (size_t i = 0; i < log.rows.size(); ++i) {
      const WindowErrors::Row& row = log.rows[i];
      const auto& t = log.rollouts[static_cast<size_t>(row.rollout)]
                          .transitions[static_cast<size_t>(row.transition)];
      if (row.coordinate == 9)
        log.residuals.errors(static_cast<Eigen::Index>(i)) += 0.5 * (t.v(3) > 0 ? 1 : -1);
    }
    const auto found = log.Find();
    INFO(found.summary);
    CHECK(found.alarm);
    CHECK(has(found, "structure", "thigh", ""));
  }
}

TEST_CASE("errors that are not finite are an alarm, and sizes have to fit") {
  FittedLog log(Robot("pendulum"), RandomLog(Robot("pendulum"), {}, 50, 1));
  CHECK_FALSE(log.Find().alarm);
  log.residuals.errors(3) = std::numeric_limits<double>::quiet_NaN();
  CHECK(log.Find().alarm);
  log.residuals.errors.conservativeResize(7);
  CHECK_THROWS_AS(log.Find(), std::invalid_argument);
}

TEST_CASE("the alarm on logs of right and wrong models, measured", "[.slow]") {
  const RobotDescription robot = Robot("hopper");
  constexpr int kLogs = 20;
  std::vector<Wrong> models = WrongModels();
  models.insert(models.begin(), {"right", {}});
  for (const Wrong& wrong : models) {
    DYNAMIC_SECTION(wrong.name) {
      int alarms = 0, first = 0, named = 0, at_contact = 0, left_free = 0;
      std::string words;
      const auto begin = std::chrono::steady_clock::now();
      for (int log = 0; log < kLogs; ++log) {
        const Misspecification found =
            Diagnose(robot, wrong.truth, 1000, 100 + static_cast<uint64_t>(log));
        const bool spoken = found.summary.find(wrong.name) != std::string::npos;
        alarms += found.alarm;
        first += !found.misfits.empty() && found.misfits[0].what.starts_with(wrong.name);
        at_contact += !found.misfits.empty() && found.misfits[0].condition == "contact";
        left_free += std::ranges::any_of(found.misfits,
                                         [](const Misfit& m) { return m.condition == "free"; });
        named += spoken;
        words += found.summary + "\n";
      }
      const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - begin;
      std::cout << fmt::format(
                       "{}: {} alarms of {}, first {}, named {}, something left in free motion {}, "
                       "{:.1f} s\n{}",
                       wrong.name, alarms, kLogs, first, named, left_free, seconds.count(), words)
                << std::endl;
      if (std::string(wrong.name) == "contact/stiffness") {
        CHECK(at_contact == kLogs);
        CHECK(left_free == 0);
      }
      CHECK(alarms == (wrong.truth.changed.empty() ? 0 : kLogs));
      if (!wrong.truth.changed.empty()) CHECK(first >= kLogs - 2);
    }
  }
}

}  // namespace plumb
