#include <fmt/format.h>

#include <catch2/catch.hpp>
#include <clocale>
#include <cmath>

#include "calibrator/motion/csv_log.h"
#include "sim/environment.h"
#include "tests/calibrator/synthetic.h"
#include "tests/temporary_file.h"

namespace plumb {
namespace {

RobotDescription Robot(const std::string& name) {
  return LoadRobot(std::string(std::getenv("PLUMBLINE_SOURCE")) + "/robots/" + name);
}
RobotDescription GymPendulum() { return Robot("pendulum/gym.toml"); }

Log Read(const std::string& contents, const RobotDescription& robot = GymPendulum()) {
  return ReadCsvLog(TemporaryFile(contents, ".csv").path(), robot);
}

/// The message of the exception that reading throws, without the file's name.
std::string Refusal(const std::string& contents, const RobotDescription& robot = GymPendulum()) {
  const TemporaryFile file(contents, ".csv");
  try {
    ReadCsvLog(file.path(), robot);
  } catch (const std::runtime_error& error) {
    const std::string what = error.what();
    REQUIRE(what.find(file.path()) == 0);
    return what.substr(file.path().size());
  }
  return "nothing";
}

/// A table as `plumb sim --csv` writes it, of episodes under random actions.
std::string SimulatedTable(const RobotDescription& robot, int episodes, int steps) {
  Environment environment(robot);
  const Task& task = environment.task();
  std::string csv = "t";
  for (const char* kind : {",q/", ",v/"}) {
    for (const JointDescription& joint : robot.joints) csv += kind + joint.name;
  }
  for (const std::string& name : task.action_names()) csv += ",u/" + name;
  csv += ",reward,terminated,truncated\n";
  const auto append = [&](double x) { csv += fmt::format(",{:.17g}", x); };
  for (uint32_t episode = 0; episode < static_cast<uint32_t>(episodes); ++episode) {
    Random random(4, {episode});
    environment.Reset(random);
    for (int i = 0; i < steps; ++i) {
      csv += fmt::format("{:.17g}", i * robot.task.period);
      for (const double x : environment.q()) append(x);
      for (const double x : environment.v()) append(x);
      Eigen::VectorXf action(task.action_size());
      for (float& a : action) a = static_cast<float>(random.Uniform(-1.2, 1.2));
      const StepResult result = environment.Step(action);
      for (int k = 0; k < task.action_size(); ++k) {
        append(environment.effort()[task.action_indices()[static_cast<size_t>(k)]] /
               task.action_unit(k));
      }
      csv += fmt::format(",{},0,{:d}\n", result.reward, i + 1 == steps);
    }
  }
  return csv;
}

/// Largest difference between what a simulator makes of a log's transitions and what the log says.
double WorstPrediction(const Log& log, const RobotDescription& robot) {
  Simulator simulator(robot);
  Eigen::VectorXd means(robot.parameters.size());
  for (size_t i = 0; i < robot.parameters.size(); ++i) {
    means(static_cast<Eigen::Index>(i)) = robot.parameters[i].mean;
  }
  simulator.SetParameters(means);
  double worst = 0;
  for (const Rollout& rollout : log.rollouts) {
    for (const Transition& t : rollout.transitions) {
      simulator.SetState(t.q, t.v);
      simulator.Step(t.efforts);
      worst = std::max({worst, (simulator.q() - t.next_q).cwiseAbs().maxCoeff(),
                        (simulator.v() - t.next_v).cwiseAbs().maxCoeff()});
    }
  }
  return worst;
}

TEST_CASE(
    "a table recorded in the simulator leads, transition by transition, to the simulator's own "
    "bits") {
  for (const char* name : {"pendulum/gym.toml", "hopper/gym.toml"}) {
    const RobotDescription robot = Robot(name);
    const Log log = Read(SimulatedTable(robot, 3, 40), robot);
    REQUIRE(log.rollouts.size() == 3);
    CHECK(log.drops.total() == 0);
    CHECK(log.warnings.empty());
    for (size_t i = 0; i < 3; ++i) {
      CHECK(log.rollouts[i].episode == static_cast<int64_t>(i));
      // where the last action led is not in the table
      REQUIRE(log.rollouts[i].transitions.size() == 39);
      for (size_t k = 0; k < 39; ++k)
        CHECK(log.rollouts[i].transitions[k].step == static_cast<int>(k));
    }
    const Transition& t = log.rollouts[0].transitions[5];
    REQUIRE(t.efforts.size() == 1);
    CHECK(t.efforts[0].duration == robot.task.period);
    CHECK(t.efforts[0].effort.size() == robot.num_velocities());
    CHECK(t.q == log.rollouts[0].transitions[4].next_q);
    for (const Eigen::VectorXd* sd : {&t.q_sd, &t.v_sd, &t.next_q_sd, &t.next_v_sd}) {
      CHECK(sd->array().isNaN().all());
    }
    CHECK(WorstPrediction(log, robot) == 0);
  }
}

TEST_CASE("a table whose velocities are differences of its positions is told of") {
  const RobotDescription robot = Pendulum();
  std::string csv = "t,q/pivot,v/pivot,u/pivot\n";
  double before = 0;
  for (int k = 0; k < 60; ++k) {
    const double q = std::sin(0.1 * k) + 1e-3 * (k * k % 7);  // a motion, and noise
    csv += fmt::format("{},{},{},0\n", k * robot.task.period, q, (q - before) / robot.task.period);
    before = q;
  }
  const Log log = Read(csv, robot);
  CHECK(log.differenced == std::vector<std::string>{"pivot"});
  REQUIRE(log.warnings.size() == 1);
  CHECK_THAT(log.warnings[0], Catch::StartsWith("v/pivot is made of differences"));
}

TEST_CASE("an action acts as late as in the simulator that recorded it") {
  RobotDescription robot = Pendulum();
  REQUIRE(robot.simulation.latency == 0.008);
  const Log log = Read(SimulatedTable(robot, 2, 40), robot);
  const auto& transitions = log.rollouts[1].transitions;
  REQUIRE(transitions[7].efforts.size() == 2);
  CHECK(transitions[7].efforts[0].duration == 0.008);
  CHECK(transitions[7].efforts[0].effort == transitions[6].efforts[1].effort);
  CHECK(transitions[0].efforts[0].effort.isZero());
  CHECK(transitions[7].duration() == Approx(robot.task.period));
  const double worst = WorstPrediction(log, robot);
  CHECK(worst < 1e-3);  // substeps do not begin where the effort changes
  robot.simulation.latency = 0;
  CHECK(WorstPrediction(Read(SimulatedTable(Pendulum(), 2, 40), robot), robot) > 10 * worst);
}

TEST_CASE("columns may be in any order, quoted, with further ones beside them") {
  const Log log = Read(
      "\xef\xbb\xbf\"u/pivot\",\"next \"\"best\"\", or so\",v/pivot,next_v/pivot, q/pivot "
      ",t,next_q/pivot\r\n"
      "# recorded on a Tuesday\r\n"
      "+1,x,0.5,\"0.6\",0.1,0,0.125\r\n"
      "-5,\"a,b\",0.9, 1 ,1e-1,0.4,nan\r\n"
      "\r\n");
  REQUIRE(log.rollouts.size() == 2);
  const Transition& a = log.rollouts[0].transitions[0];
  const Transition& b = log.rollouts[1].transitions[0];
  CHECK(a.q(0) == 0.1);
  CHECK(a.v(0) == 0.5);
  CHECK(a.next_q(0) == 0.125);
  CHECK(a.next_v(0) == 0.6);
  CHECK(a.efforts[0].effort(0) == 1);
  CHECK(a.efforts[0].duration == 0.05);
  CHECK(a.q_sd(0) == 0);
  CHECK(std::isnan(a.next_q_sd(0)));
  CHECK(std::isnan(b.next_q(0)));
  CHECK(b.next_v(0) == 1);
  CHECK(b.efforts[0].effort(0) == -2);  // clipped as the task does
  REQUIRE(log.warnings.size() == 2);
  CHECK(log.warnings[0] == "the same in all rows: q/pivot");
  CHECK(log.warnings[1].find("1 actions go beyond") == 0);
}

TEST_CASE("numbers have a decimal point in every locale") {
  const std::string old = std::setlocale(LC_ALL, nullptr);
  for (const char* locale : {"de_DE.UTF-8", "de_DE.utf8", "fr_FR.UTF-8"}) {
    if (std::setlocale(LC_ALL, locale)) break;
  }
  CHECK(Read("t,q/pivot,v/pivot,u/pivot\n0,1.5,0,0\n0.05,1.25,0,0\n")
            .rollouts[0]
            .transitions[0]
            .next_q(0) == 1.25);
  std::setlocale(LC_ALL, old.c_str());
}

/// A table with next_ columns of a robot that is seen with noise, from `rows` of t; each row ends
/// near where the next begins.
std::string NextTable(double interval, int rows, double noise, bool random_starts = false) {
  Random random(3);
  std::string csv = "t,q/pivot,v/pivot,u/pivot,next_q/pivot,next_v/pivot\n";
  const auto q = [](int i) { return std::sin(0.3 * i); };
  const auto v = [](int i) { return 6 * std::cos(0.3 * i); };
  for (int i = 0; i < rows; ++i) {
    const double start_q = random_starts ? random.Uniform(-3, 3) : q(i),
                 start_v = random_starts ? random.Uniform(-8, 8) : v(i);
    const double end_q = random_starts ? start_q + 0.1 : q(i + 1) + noise * random.Normal();
    const double end_v = random_starts ? start_v - 0.1 : v(i + 1) + noise * random.Normal();
    csv += fmt::format("{},{},{},{},{},{}\n", i * interval, start_q, start_v, random.Uniform(-2, 2),
                       end_q, end_v);
  }
  return csv;
}

TEST_CASE("rows follow each other if a state is what the row before led to, noise allowed") {
  SECTION("the very same reading: its noise is in both") {
    const Log log = Read(NextTable(0.05, 50, 0));
    REQUIRE(log.rollouts.size() == 1);
    REQUIRE(log.rollouts[0].transitions.size() == 50);
    for (const Transition& t : log.rollouts[0].transitions) {
      CHECK(std::isnan(t.q_sd(0)));
      CHECK(t.duration() == 0.05);
    }
    CHECK(log.rollouts[0].transitions[49].step == 49);
  }
  SECTION("noise on s' alone: s is exact") {
    const Log log = Read(NextTable(0.05, 50, 0.01));
    REQUIRE(log.rollouts.size() == 1);
    CHECK(log.rollouts[0].transitions.size() == 50);
    for (const Transition& t : log.rollouts[0].transitions) CHECK(t.q_sd(0) == 0);
  }
  SECTION("unconnected transitions stay so, even where they happen to be near") {
    const Log log = Read(NextTable(0.05, 2000, 0, true));
    CHECK(log.rollouts.size() == 2000);
    CHECK(log.drops.total() == 0);
    CHECK(log.rollouts[1999].episode == 1999);
  }
  SECTION("at whatever times they were made") {
    CHECK(Read(NextTable(0.7, 20, 0, true)).rollouts.size() == 20);
  }
  SECTION("at a pace that is nearly the period") {
    const Log log = Read(NextTable(0.055, 20, 0));
    CHECK(log.rollouts[0].transitions[3].duration() == Approx(0.055));
    CHECK(log.rollouts[0].transitions[19].duration() == 0.05);  // nobody knows
  }
}

TEST_CASE(
    "what cannot be used is dropped and counted, and splits an episode or leaves a gap in its "
    "steps") {
  const std::string head = "t,q/pivot,v/pivot,u/pivot\n";
  SECTION("states and actions that are not known") {
    const Log log = Read(
        head +
        "0,0.1,0,1\n0.05,0.2,nan,1\n0.1,0.3,0,1\n0.15,0.4,0,\n0.2,0.5,0,0\n0.25,,,0\n0.3,1,0,0\n");
    REQUIRE(log.rollouts.size() == 1);
    REQUIRE(log.rollouts[0].transitions.size() == 2);
    CHECK(log.rollouts[0].transitions[0].step == 0);
    CHECK(log.rollouts[0].transitions[0].next_q(0) == 0.2);
    CHECK(std::isnan(log.rollouts[0].transitions[0].next_v(0)));
    CHECK(log.rollouts[0].transitions[1].step == 2);
    CHECK(log.drops.not_finite == 4);
    CHECK(log.drops.total() == 4);
  }
  SECTION("a gap in time") {
    const Log log = Read(head + "0,0.1,0,1\n0.05,0.2,0,1\n0.25,0.3,0,1\n0.3,0.4,0,0\n");
    REQUIRE(log.rollouts.size() == 2);
    CHECK(log.rollouts[1].transitions[0].step == 0);
    CHECK(log.drops.late == 1);
  }
  SECTION("what was applied before a gap in time, where actions act late") {
    const Log log = Read(
        head + "0,0.1,0,1\n0.05,0.2,0,1\n0.25,0.3,0,1\n0.3,0.4,0,0\n0.35,0.5,0,0\n", Pendulum());
    REQUIRE(log.rollouts.size() == 2);
    CHECK(log.rollouts[1].transitions[0].step == 1);
    CHECK(log.rollouts[1].transitions[0].efforts[0].effort(0) == 1);
    CHECK(log.drops.late == 1);
    CHECK(log.drops.gap == 1);
  }
  SECTION("a part at another rate") {
    const Log log =
        Read(head + "0,0.1,0,1\n0.05,0.2,0,1\n0.06,0.3,0,1\n0.07,0.4,0,0\n0.12,0.5,0,0\n");
    CHECK(log.rollouts.size() == 2);
    CHECK(log.drops.late == 2);
  }
  SECTION("ends of episodes") {
    const Log log = Read(
        "t,q/pivot,v/pivot,u/"
        "pivot,terminated,truncated\n0,1,0,1,0,0\n0.05,2,0,1,1,0\n0.1,3,0,1,0,0\n"
        "0.15,4,0,0,False,True\n0.15,5,0,0,,0\n0.2,6,0,0,0,0\n");
    REQUIRE(log.rollouts.size() == 3);
    CHECK(log.rollouts[2].transitions[0].next_q(0) == 6);
    CHECK(log.drops.total() == 0);
  }
}

TEST_CASE("a table of one transition") {
  CHECK(Read("t,q/pivot,v/pivot,u/pivot\n0,1,0,1\n0.05,2,0,1").rollouts[0].transitions.size() == 1);
  CHECK(Read("t,q/pivot,v/pivot,u/pivot,next_q/pivot,next_v/pivot\n7,1,0,1,2,nan\n")
            .rollouts[0]
            .transitions.size() == 1);
}

TEST_CASE("constant signals are worth a warning") {
  const Log log = Read("t,q/pivot,v/pivot,u/pivot\n0,1,0,0\n0.05,1,0,0\n0.1,1,0,0\n");
  CHECK(log.rollouts[0].transitions.size() == 2);
  CHECK(log.warnings == std::vector<std::string>{"the same in all rows: q/pivot, v/pivot"});
}

TEST_CASE("a joint without a motor has no action, and a spherical one a quaternion") {
  RobotDescription robot = Robot("hopper");
  std::string with_root = SimulatedTable(robot, 1, 5);
  with_root.replace(with_root.find("reward"), 6, "u/rootx");
  CHECK(Refusal(with_root, robot) ==
        ":1: column 'u/rootx' is of no joint with a motor of robot 'hopper'; the nearest is "
        "'q/rootx'");

  robot = GymPendulum();
  JointDescription ball = robot.joints[0];
  ball.name = "ball";
  ball.type = JointDescription::Type::kSpherical;
  ball.passive = true;
  robot.joints.push_back(ball);
  robot.task.name = "reach";
  robot.task.target = {0, 1, 0, 0, 0};
  const Log log = Read(
      "t,q/pivot,q/ball/w,q/ball/x,q/ball/y,q/ball/z,v/pivot,v/ball/x,v/ball/y,v/ball/z,u/pivot\n"
      "0,1,2,3,4,5,6,7,8,9,1\n0.05,0,1,0,0,0,0,0,0,0,0\n",
      robot);
  CHECK(log.rollouts[0].transitions[0].q == (Eigen::VectorXd(5) << 1, 2, 3, 4, 5).finished());
  CHECK(log.rollouts[0].transitions[0].v == Eigen::Vector4d(6, 7, 8, 9));
  CHECK(log.rollouts[0].transitions[0].efforts[0].effort == Eigen::Vector4d(1, 0, 0, 0));
}

TEST_CASE("a table that cannot be right is refused with its line and the reason") {
  const std::string head = "t,q/pivot,v/pivot,u/pivot\n", two = head + "0,1,0,0\n0.05,1,0,0\n";
  const std::string zero("t,q/pivot\0,v/pivot\n", 18);
  struct Case {
    const char* name;
    std::string contents, refusal;
  };
  const std::vector<Case> cases{
      {"empty", "", ": is empty"},
      {"only blank lines", "\n\n  \n# nothing\n", ": is empty"},
      {"header only", head, ": has a head but no rows"},
      {"one row", head + "0,1,0,0\n",
       ": no transition can be used: no row is followed by another of its episode, and there are "
       "no next_ "
       "columns"},
      {"truncated line", two + "0.1,1", ":4: has 2 fields where the head has 4"},
      {"too many fields", two + "0.1,1,2,3,4\n", ":4: has 5 fields where the head has 4"},
      {"semicolons", "t;q/pivot;v/pivot;u/pivot\n0;1;0;0\n",
       ":1: columns must be separated by commas"},
      {"tabs", "t\tq/pivot\n0\t1\n", ":1: columns must be separated by commas"},
      {"prose", "It was a dark and stormy night\n", ":1: is no head of a table: it has no comma"},
      {"no number", head + "0,1,0,x1\n", ":2: 'u/pivot' is 'x1': that is no number"},
      {"half a number", head + "0,1,0,1.5.2\n", ":2: 'u/pivot' is '1.5.2': that is no number"},
      {"hexadecimal", head + "0,1,0,0x10\n", ":2: 'u/pivot' is '0x10': that is no number"},
      {"two signs", head + "0,1,0,+-1\n", ":2: 'u/pivot' is '+-1': that is no number"},
      {"infinite", two + "0.1,inf,0,0\n",
       ":4: 'q/pivot' is 'inf': it must be finite, or nan where nothing was observed"},
      {"too large", two + "0.1,1e999,0,0\n",
       ":4: 'q/pivot' is '1e999': a number too large or too small for a double"},
      {"no time", head + "nan,1,0,0\n", ":2: t must be known"},
      {"duplicate time", two + "# a comment\n0.05,1,0,0\n", ":5: t is 0.05, as in the row before"},
      {"missing column", "t,q/pivot,w/pivot,u/pivot\n0,1,0,0\n",
       ":1: has no column 'v/pivot'; the nearest is 'q/pivot'"},
      {"missing next_v", "t,q/pivot,v/pivot,u/pivot,next_q/pivot\n0,1,0,0,1\n",
       ":1: has no column 'next_v/pivot'; the nearest is 'next_q/pivot'"},
      {"wrong robot", "t,q/thigh,v/thigh,u/thigh\n0,1,0,0\n",
       ":1: column 'q/thigh' is of no joint of robot 'pendulum'; the nearest is 'q/pivot'"},
      {"misspelt", "t,q/pivot,v/pivto,u/pivot\n0,1,0,0\n",
       ":1: column 'v/pivto' is of no joint of robot 'pendulum'; the nearest is 'v/pivot'"},
      {"column twice", "t,q/pivot,v/pivot,u/pivot,t\n0,1,0,0,0\n", ":1: column 't' is there twice"},
      {"open quotation", "t,\"q/pivot,v/pivot,u/pivot\n0,1,0,0\n", ":1: a quotation has no end"},
      {"text after a quotation", "t,\"q/pivot\"x,v/pivot,u/pivot\n",
       ":1: something follows a quotation"},
      {"other rate", head + "0,1,0,0\n0.02,1,0,0\n0.04,1,0,0\n",
       ": no transition can be used: its rows are 0.02 s apart, but the task's control period is "
       "0.05 s"},
      {"other rate with s'", NextTable(0.01, 20, 0.01),
       ": no transition can be used: its rows are 0.01 s apart, but the task's control period is "
       "0.05 s"},
      {"nothing observed", head + "0,nan,0,0\n0.05,nan,0,0\n",
       ": no transition can be used: 0 gaps, 0 late, 1 not finite, 0 across restarts"},
      {"a zero byte", zero, ":1: is no text: it has a zero byte"},
      {"binary",
       std::string("\x7f"
                   "ELF\x02\x01\x01\0\0\0",
                   10),
       ":1: is no text: it has a zero byte"},
      {"garbage", "\x93\xff\xfe\x81,\xd0\x01\n\x80,\x90\n",
       ":1: has no column 't'; the nearest is '?"
       "?'"},
      {"one endless line", std::string((size_t{1} << 20) + 1, 'x'),
       ":1: is longer than a megabyte"},
  };
  for (const Case& c : cases) {
    INFO(c.name);
    CHECK(Refusal(c.contents) == c.refusal);
  }
  const RobotDescription robot = GymPendulum();
  CHECK_THROWS_WITH(ReadCsvLog("/nonexistent/log.csv", robot),
                    "/nonexistent/log.csv: cannot be opened");
  CHECK_THROWS_WITH(ReadCsvLog("/tmp", robot), "/tmp: is a folder");
}

/// Mistakes that people, editors and disks make.
std::string Mutant(std::string text, Random& random) {
  static const std::string kTokens[] = {"nan", "",     "inf",   "1e999",  "-", ",",     "\n",
                                        "\"",  "0.05", "1e308", "-1e308", "#", "\r\n",  "t",
                                        "q/",  "0",    "\t",    ";",      "1", "5e-324"};
  const auto below = [&](size_t n) { return n == 0 ? size_t{0} : random.Bits() % n; };
  for (size_t mistakes = 1 + below(4); mistakes > 0; --mistakes) {
    const size_t at = below(text.size()), length = below(40);
    switch (below(6)) {
      case 0:
        text.erase(at, length);
        break;
      case 1:
        text.insert(at, text.substr(below(text.size()), length));
        break;
      case 2:
        text.insert(at, kTokens[below(std::size(kTokens))]);
        break;
      case 3:
        text.resize(at);
        break;
      case 4: {  // another value for a field
        const size_t begin = text.find_last_of(",\n", at) + 1, end = text.find_first_of(",\n", at);
        text.replace(std::min(begin, text.size()),
                     end == std::string::npos ? end : end - std::min(begin, end),
                     kTokens[below(std::size(kTokens))]);
        break;
      }
      default:
        if (!text.empty()) text[at] = static_cast<char>(random.Bits());
    }
  }
  return text;
}

TEST_CASE("whatever happens to a table, it is refused or read as finite transitions") {
  const RobotDescription pendulum = GymPendulum(), delayed = Pendulum();
  const std::string originals[] = {SimulatedTable(pendulum, 2, 6), NextTable(0.05, 10, 0.01)};
  Random random(21);
  int refused = 0, read = 0;
  const TemporaryFile file("", ".csv");
  for (int i = 0; i < 6000; ++i) {
    const std::string mutant = Mutant(originals[i % 2], random);
    file.Write(mutant);
    INFO(mutant);
    try {
      const Log log = ReadCsvLog(file.path(), i % 3 == 0 ? delayed : pendulum);
      ++read;
      for (const Rollout& rollout : log.rollouts) {
        REQUIRE_FALSE(rollout.transitions.empty());
        int step = -1;
        for (const Transition& t : rollout.transitions) {
          REQUIRE(t.step > step);
          step = t.step;
          REQUIRE((t.q.allFinite() && t.v.allFinite()));
          REQUIRE((!std::isnan(t.next_q(0)) || !std::isnan(t.next_v(0))));
          REQUIRE_FALSE((std::isinf(t.next_q(0)) || std::isinf(t.next_v(0))));
          REQUIRE(t.duration() == Approx(0.05).epsilon(0.21));
          for (const EffortSegment& segment : t.efforts) {
            REQUIRE(segment.duration > 0);
            REQUIRE(std::abs(segment.effort(0)) <= 2);
          }
        }
      }
    } catch (const std::runtime_error& error) {
      ++refused;
      REQUIRE(std::string(error.what()).find(file.path()) == 0);
    }
  }
  CHECK(refused > 1000);
  CHECK(read > 500);
}

}  // namespace
}  // namespace plumb
