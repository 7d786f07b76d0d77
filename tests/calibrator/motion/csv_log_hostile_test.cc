#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <stdexcept>
#include <string>
#include <vector>

#include "calibrator/motion/csv_log.h"
#include "common/random.h"
#include "tests/calibrator/motion/csv_tables.h"
#include "tests/calibrator/synthetic.h"
#include "tests/temporary_file.h"

namespace plumb {
namespace {

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
      {"not physical", two + "0.1,-1e150,0,0\n",
       ":4: 'q/pivot' is -1e+150: beyond 1000000000 nothing is a robot's"},
      {"time", two + "1e150,0,0,0\n",
       ":4: 't' is 1e+150: beyond 1000000000000 nothing is a robot's"},
      {"too large", two + "0.1,1e999,0,0\n",
       ":4: 'q/pivot' is '1e999': a number too large or too small for a double"},
      {"no time", head + "nan,1,0,0\n", ":2: t must be known"},
      {"duplicate time", two + "# a comment\n0.05,1,0,0\n", ":5: t is 0.05, as in the row before"},
      {"missing column", "t,w/pivot,v/pivot,u/pivot\n0,1,0,0\n",
       ":1: has no column 'q/pivot'; the nearest is 'w/pivot'"},
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
  for (int i = 0; i < 7000; ++i) {
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
          REQUIRE((t.q.cwiseAbs().maxCoeff() <= 1e9 && t.v.cwiseAbs().maxCoeff() <= 1e9));
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
