#include "calibrator/report/report.h"

#include <catch2/catch.hpp>
#include <cstdlib>
#include <fstream>
#include <regex>
#include <sstream>

#include "calibrator/report/report_residuals.h"
#include "plot/svg.h"
#include "robot/urdf/xml.h"
#include "tests/calibrator/sample_findings.h"
#include "tests/calibrator/synthetic.h"
#include "tests/robot/zoo.h"

namespace plumb {
namespace {

using Catch::Contains;

Residuals SampleResiduals(const RobotDescription& robot) {
  Residuals residuals;
  for (const char* kind : {"q ", "v "}) {
    for (const JointDescription& joint : robot.joints)
      residuals.coordinates.push_back(kind + joint.name);
  }
  const auto coordinates = static_cast<int>(residuals.coordinates.size());
  Random random(8, {2});
  residuals.whitened.resize(3 * 150 * coordinates);
  std::vector<double> last(residuals.coordinates.size(), 0);
  for (int rollout = 0; rollout < 3; ++rollout) {
    for (int transition = 0; transition < 150; ++transition) {
      for (int coordinate = 0; coordinate < coordinates; ++coordinate) {
        double& r = last[static_cast<size_t>(coordinate)];
        r = (coordinate == 1 ? 0.5 : 0) * r + random.Normal();  // one is not white
        residuals.whitened(static_cast<Eigen::Index>(residuals.rows.size())) = r;
        residuals.rows.push_back({150 * rollout + transition, rollout, transition, coordinate});
      }
    }
  }
  return residuals;
}

RobotDescription ManyParameters(int count) {
  RobotDescription robot =
      LoadRobot(std::string(std::getenv("PLUMBLINE_SOURCE")) + "/robots/hopper");
  while (static_cast<int>(robot.parameters.size()) < count) {
    ParameterDescription p = robot.parameters[robot.parameters.size() % 4];
    p.name = "inertia/body_" + std::to_string(robot.parameters.size()) + "/xx", p.unit = "kg m^2";
    robot.parameters.push_back(p);
  }
  return robot;
}

/// A page that is XML, needs nothing from elsewhere, and draws with numbers.
void CheckPage(const std::string& html) {
  CHECK_NOTHROW(Xml(html, "report.html"));
  for (const char* elsewhere : {"src=", "href=", "url(", "@import", "<script"})
    CHECK_THAT(html, !Contains(elsewhere));
  for (const char* nothing : {"\"nan", "\"inf", "\"-nan", " nan", "Mnan", "Lnan", "-inf"})
    CHECK_THAT(html, !Contains(nothing));
}

// PLUMBLINE_REPORTS=<folder> keeps the pages, to look at them.
void Keep(const std::string& name, const std::string& html) {
  if (const char* folder = std::getenv("PLUMBLINE_REPORTS"))
    std::ofstream(std::string(folder) + "/" + name) << html;
}

size_t Count(const std::string& text, const std::string& part) {
  size_t count = 0;
  for (size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) ++count;
  return count;
}

TEST_CASE("the report says in words and drawings what was found") {
  const RobotDescription robot = Pendulum();
  const Findings findings = SampleFindings(robot);
  const std::string html = ReportHtml(findings, robot, SampleProvenance(), SampleResiduals(robot));
  Keep("pendulum.html", html);
  CheckPage(html);
  for (const char* words :
       {"Calibration of pendulum", "only gravity / length can be known",
        "The model does not explain the robot", "Predicts better than the prior", "The logs agree",
        "Warning</b>12 transitions were late", "10.40 \xc2\xb1 0.57",
        "only in combination with mass/pole, length/pole", "pivot, at ground contact", "31 %",
        "tuesday.lcm", "robots/pendulum monday.lcm tuesday.lcm --seed 3", "18364758544493064720",
        "importance weights", "What the model lacks", "What it lacks", "295 touching", "75 %"}) {
    CHECK_THAT(html, Contains(words));
  }
  CHECK(Count(html, "<svg class=\"plot\"") ==
        1 + 1 + 1 + 1 + 1 + 2 * 3 + 3);  // pairs, scree, errors, lacking, time, residuals, logs
  // Two contours each of the prior and two components, in three pairs.
  CHECK(Count(html, "Z\"/>") == 3 * 2 * 3);
  CHECK(html.size() < 1'000'000);
}

TEST_CASE("of many parameters the eight are drawn that the data have told most about") {
  const RobotDescription robot = ManyParameters(12);
  Findings findings = SampleFindings(robot);
  for (const Eigen::Index k : {2, 3, 5, 7}) {  // these the data have not told about
    for (Gaussian& g : findings.posterior.components) {
      g.covariance.row(k).setZero(), g.covariance.col(k).setZero();
      g.covariance(k, k) = findings.prior.covariance(k, k);
    }
  }
  const std::string html = ReportHtml(findings, robot, SampleProvenance(), SampleResiduals(robot));
  Keep("many.html", html);
  CheckPage(html);
  CHECK_THAT(html,
             Contains("Of 12 parameters these are the 8 that the data have told most about."));
  const std::string pairs =
      html.substr(html.find("<h3>Prior and posterior"),
                  html.find("<h3>What can") - html.find("<h3>Prior and posterior"));
  for (const char* there : {">mass/torso", "mass/thigh", "inertia/body_4/xx", "inertia/body_6/xx"})
    CHECK_THAT(html, Contains(there));
  CHECK_THAT(pairs, !Contains("mass/leg") && !Contains("mass/foot") && !Contains("y_5/xx") &&
                        !Contains("y_7/xx"));
  CHECK(Count(pairs, "Z\"/>") == 28 * 2 * 3);
}

TEST_CASE("a model that nobody could judge is not said to explain the robot") {
  const RobotDescription robot = Pendulum();
  Findings findings = SampleFindings(robot);
  findings.misspecification = {};
  findings.misspecification.summary = "errors as large as they should be";
  CHECK_THAT(ReportHtml(findings, robot, SampleProvenance(), {}),
             Contains("<b>The model explains the robot</b>"));
  findings.misspecification.judged = false;
  findings.misspecification.summary = "only 15 of 115 transitions can tell";
  const std::string html = ReportHtml(findings, robot, SampleProvenance(), {});
  CHECK_THAT(html, !Contains("The model explains the robot"));
  CHECK_THAT(html, Contains("Nobody can tell whether the model explains the robot"));
}

TEST_CASE("whatever files call things, the page stays a page") {
  RobotDescription robot = Pendulum();
  const std::string evil = "</title><script>alert('\"&')</script>\xff\x01\xed\xa0\x80-->";
  robot.name = evil, robot.file = evil;
  robot.parameters[1].unit = evil;
  robot.parameters[2].name = evil;
  Findings findings = SampleFindings(robot);
  findings.method = findings.used = findings.check = findings.warnings[0] = evil;
  findings.identifiability.summary = findings.identifiability.combinations[0].name = evil;
  findings.misspecification.summary = findings.misspecification.misfits[0].what =
      findings.misspecification.misfits[0].test = evil;
  findings.holdout.summary = findings.agreement.summary = findings.agreement.logs[0].log = evil;
  Residuals residuals = SampleResiduals(robot);
  residuals.coordinates[0] = evil;
  const std::string html =
      ReportHtml(findings, robot, {{evil}, {{evil, evil}}, evil, evil}, residuals);
  CheckPage(html);
  CHECK_THAT(html, !Contains("alert('") && !Contains("\xff") && !Contains("\x01"));
  CHECK(Escape("a<b>&\"'\xc3\xa9\n") == "a&lt;b&gt;&amp;&quot;&#39;\xc3\xa9\n");
  for (const char* broken : {"\xff", "\xc3", "\xe0\x80\x80", "\xed\xa0\x80", "\xf4\x90\x80\x80",
                             "\xef\xbf\xbf", "\x01", "\x7f"}) {
    CHECK(Escape(broken).starts_with("\xef\xbf\xbd"));
  }
}

TEST_CASE("findings with little in them still make a report") {
  const RobotDescription robot = Pendulum();
  const Findings full = SampleFindings(robot);
  Findings findings;
  findings.prior = full.prior;
  findings.posterior = {{1}, {full.prior}};
  findings.discrepancy = NAN;
  const std::string html = ReportHtml(findings, robot, {}, {});
  Keep("little.html", html);
  CheckPage(html);
  CHECK_THAT(html, Contains("Predictions were not tested") &&
                       Contains("hardly: the motion adds little to the prior") &&
                       Contains("There are none."));
  // A question that was not examined is not shown as good news.
  CHECK_THAT(html,
             Contains("The model was not tested") && Contains("Identifiability was not examined"));
  CHECK_THAT(html, !Contains("The logs") && !Contains("verdict good") && !Contains("verdict bad"));
}

TEST_CASE("numbers that are none are left out of the drawings") {
  const RobotDescription robot = Pendulum();
  Findings findings = SampleFindings(robot);
  for (HorizonError& e : findings.holdout.errors) e.posterior = e.prior = NAN;
  findings.identifiability.information.setConstant(NAN);
  findings.identifiability.null[0].setConstant(NAN);
  findings.misspecification.misfits[0].statistic = INFINITY;
  findings.agreement.logs[0].mean.setConstant(NAN), findings.agreement.logs[1].sd.resize(0);
  findings.cramer_rao.setConstant(NAN), findings.stages[0].discrepancy = NAN;
  findings.samples = findings.samples.col(0).replicate(1, 50).eval();  // without any width
  Residuals residuals = SampleResiduals(robot);
  residuals.whitened(7) = NAN, residuals.whitened(8) = INFINITY, residuals.whitened(9) = 1e300;
  const std::string html = ReportHtml(findings, robot, SampleProvenance(), residuals);
  CheckPage(html);
  CHECK_THAT(html, Contains("and 2 without a number"));
  residuals.whitened.setConstant(NAN);
  CheckPage(ReportHtml(findings, robot, SampleProvenance(), residuals));
  residuals.rows[0].coordinate = 2;
  CHECK_THROWS_AS(ReportHtml(findings, robot, SampleProvenance(), residuals),
                  std::invalid_argument);
  residuals.rows.pop_back();
  CHECK_THROWS_AS(ReportHtml(findings, robot, SampleProvenance(), residuals),
                  std::invalid_argument);
}

TEST_CASE("a posterior much narrower than its prior is drawn with its surroundings, not as a dot") {
  const RobotDescription robot = Pendulum();
  Findings findings = SampleFindings(robot);
  findings.posterior = {{1}, {{findings.prior.mean, 1e-6 * findings.prior.covariance}}};
  findings.samples.resize(0, 0);
  findings.identifiability.null.clear();
  const std::string html = ReportHtml(findings, robot, SampleProvenance(), SampleResiduals(robot));
  Keep("narrow.html", html);
  CheckPage(html);
  // The first pair of posterior contours: as wide as a good part of a cell.
  const size_t path = html.find("posterior line\" d=\"M");
  REQUIRE(path != std::string::npos);
  std::istringstream numbers(html.substr(path + 20, html.find('Z', path) - path - 20));
  double low = 1e9, high = -1e9, x = 0, y = 0;
  for (char separator; numbers >> x >> y; numbers >> separator)
    low = std::min(low, x), high = std::max(high, x);
  CHECK(high - low > 25);
  CHECK(high - low < 250);
  // And where that is in the prior.
  std::smatch narrower;
  REQUIRE(std::regex_search(html, narrower, std::regex(">([0-9.]+) times narrower")));
  CHECK(std::stod(narrower[1]) == Approx(1000).epsilon(0.1));
  CHECK_THAT(html, Contains("<td class=\"n\">yes</td>"));
}

TEST_CASE("the report of a robot with every coordinate there is") {
  const RobotFolder folder(kZooUrdf, kZooToml);
  const RobotDescription robot = LoadRobot(folder.path());
  const std::string html = ReportHtml(SampleFindings(robot), robot, SampleProvenance(), {});
  Keep("zoo.html", html);
  CheckPage(html);
}

TEST_CASE("autocorrelation is that of an autoregressive process, within roll-outs") {
  Residuals residuals;
  residuals.coordinates = {"a", "b"};
  Random random(1, {});
  const int n = 20000;
  residuals.whitened.resize(2 * n);
  double a = 0;
  for (int i = 0; i < n; ++i) {
    a = 0.6 * a + random.Normal();
    residuals.whitened(2 * i) = a, residuals.whitened(2 * i + 1) = random.Normal();
    residuals.rows.push_back({i, 0, i, 0}), residuals.rows.push_back({i, 0, i, 1});
  }
  const std::vector<double> correlated = Autocorrelation(residuals, 0, 3),
                            white = Autocorrelation(residuals, 1, 3);
  for (int lag = 1; lag <= 3; ++lag) {
    CHECK(correlated[static_cast<size_t>(lag - 1)] == Approx(std::pow(0.6, lag)).margin(0.04));
    CHECK(white[static_cast<size_t>(lag - 1)] == Approx(0).margin(0.03));
  }
  for (size_t i = 0; i < residuals.rows.size(); ++i)
    residuals.rows[i].rollout = static_cast<int>(i / 2);
  CHECK(std::isnan(Autocorrelation(residuals, 0, 1)[0]));  // every transition a roll-out of its own
}

}  // namespace
}  // namespace plumb
