// Text that came from outside, in whatever is written as HTML or SVG: the two reports, and figures.

#include <catch2/catch.hpp>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <set>
#include <string>

#include "calibrator/report/report.h"
#include "cli/launch_report.h"
#include "cli/training_report.h"
#include "plot/curves.h"
#include "robot/urdf/xml.h"
#include "tests/calibrator/sample_findings.h"
#include "tests/cli/sample_summary.h"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using Catch::Contains;

const fs::path kSource = std::getenv("PLUMBLINE_SOURCE");

/// What somebody has called a thing: a script, quotes that end an attribute, half a character, a
/// surrogate, an escape sequence and a mark that turns the direction of writing.
std::string Evil(const std::string& thing) {
  return thing + "</title><script>alert('\"&')</script>\xc3\xed\xa0\x80\x1b[2J\xe2\x80\xae-->";
}

/// The same as a page may have it, written out by hand.
std::string Harmless(const std::string& thing) {
  const std::string none = "\xef\xbf\xbd";  // U+FFFD
  return thing + "&lt;/title&gt;&lt;script&gt;alert(&#39;&quot;&amp;&#39;)&lt;/script&gt;" + none +
         none + none + none + none + "[2J" + none + "--&gt;";
}

/// It is XML, has all that it was told, and as text.
void CheckHarmless(const std::string& page, const std::set<std::string>& things) {
  CHECK_NOTHROW(Xml(page, "page"));
  for (const char* raw : {"<script", "alert('", "\"&'", "\x1b", "\xed\xa0", "\xe2\x80\xae"})
    CHECK_THAT(page, !Contains(raw));
  for (const std::string& thing : things) CHECK_THAT(page, Contains(Harmless(thing)));
}

RobotDescription EvilRobot() {
  RobotDescription robot = LoadRobot(kSource / "robots/pendulum");
  robot.name = Evil("robot"), robot.file = Evil("file"), robot.task.name = Evil("task");
  for (JointDescription& joint : robot.joints) joint.name = Evil("joint");
  for (ParameterDescription& parameter : robot.parameters)
    parameter.name = Evil("parameter"), parameter.unit = Evil("unit");
  return robot;
}

TEST_CASE("in a calibration's report, text from outside is text") {
  const RobotDescription robot = EvilRobot();
  Findings f = SampleFindings(robot);
  f.method = Evil("method"), f.used = Evil("used"), f.check = Evil("check");
  f.warnings = {Evil("warning")}, f.advice = Evil("advice");
  f.identifiability.summary = Evil("known");
  f.identifiability.combinations[0].name = Evil("combination");
  f.misspecification.summary = Evil("misfits"), f.holdout.summary = Evil("holdout");
  f.misspecification.misfits[0].what = Evil("misfit");
  f.misspecification.misfits[0].test = Evil("test");
  f.gap.summary = Evil("gap"), f.agreement.summary = Evil("agreement");
  f.agreement.logs[0].log = Evil("log");
  const Residuals residuals{Eigen::VectorXd::Zero(1), {{0, 0, 0, 0}}, {Evil("coordinate")}};
  const Provenance provenance{
      {Evil("table")}, {{Evil("option"), Evil("value")}}, Evil("command"), Evil("date")};
  CheckHarmless(
      ReportHtml(f, robot, provenance, residuals),
      {"robot",  "file",    "joint",   "parameter", "unit",        "method",     "used",
       "check",  "warning", "advice",  "known",     "combination", "misfits",    "holdout",
       "misfit", "test",    "gap",     "agreement", "log",         "coordinate", "table",
       "option", "value",   "command", "date"});
}

TEST_CASE("in a training's report, text from outside is text") {
  const RobotDescription robot = EvilRobot();
  TrainingOutcome outcome;
  outcome.command = Evil("command"), outcome.distribution = Evil("distribution");
  CheckHarmless(TrainingReport(robot, ParameterDistribution::Prior(robot), outcome,
                               {TrainingRow{}, TrainingRow{}}),
                {"robot", "file", "task", "parameter", "unit", "command", "distribution"});
}

TEST_CASE("in a run's report, text from outside is text") {
  const RobotDescription robot = EvilRobot();
  nlohmann::json summary = SampleSummary();
  for (const char* field : {"bus", "time", "version", "identifiability"})
    summary[field] = Evil(field);
  summary["policy"]["why"] = Evil("why"), summary["decisions"][0]["summary"] = Evil("decision");
  summary["iterations"][1]["alarm"] = Evil("alarm"), summary["iterations"][1]["gap"] = Evil("gap");
  summary["iterations"][1]["combinations"][0]["name"] = Evil("combination");
  CheckHarmless(LaunchReport(robot, summary, Evil("command")),
                {"robot", "file", "parameter", "unit", "bus", "time", "version", "identifiability",
                 "why", "decision", "alarm", "gap", "combination", "command"});
}

TEST_CASE("in a figure, text from outside is text") {
  const Curve curve{Evil("curve"), {1, 2}, {1, 2}, {0, 1}, {2, 3}};
  CheckHarmless(DrawCurves(Evil("title"), {{Evil("panel"), Evil("x"), Evil("y"), false, {curve}}}),
                {"title", "panel", "x", "y", "curve"});
}

// Who else writes HTML belongs above, and then here; SVG is escaped where all of it is drawn, as
// the figure's is.
TEST_CASE("nothing else writes HTML or SVG") {
  std::set<std::string> writers;
  for (auto entry = fs::recursive_directory_iterator(kSource); entry != end(entry); ++entry) {
    const std::string name = entry->path().filename();
    const bool foreign = name.starts_with(".") || name.starts_with("build") || name == "tests" ||
                         name == "node_modules";
    if (entry->is_directory() && foreign) entry.disable_recursion_pending();
    if (entry->path().extension() != ".cc") continue;
    std::ifstream stream(entry->path());
    const std::string text{std::istreambuf_iterator<char>(stream), {}};
    for (const char* sign : {"\"plot/svg.h\"", "\"plot/html.h\"", "<svg", "<html"}) {
      if (text.find(sign) != std::string::npos)
        writers.insert(fs::relative(entry->path(), kSource).string());
    }
  }
  CHECK(writers == std::set<std::string>{
                       "calibrator/report/pair_plot.cc", "calibrator/report/report.cc",
                       "calibrator/report/report_checks.cc", "calibrator/report/report_plots.cc",
                       "calibrator/report/report_residuals.cc", "cli/launch_report.cc",
                       "cli/run_plots.cc", "cli/training_report.cc", "experiments/figure_1.cc",
                       "experiments/learning_curves.cc", "plot/curves.cc", "plot/html.cc",
                       "plot/svg.cc"});
}

}  // namespace
}  // namespace plumb
