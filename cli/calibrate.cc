#include "cli/calibrate.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <cmath>
#include <ctime>
#include <filesystem>
#include <iostream>
#include <memory>

#include "calibrator/diagnostics/robot_sbc.h"
#include "calibrator/report/report.h"
#include "calibrator/results/identified_urdf.h"
#include "calibrator/results/posterior_file.h"
#include "calibrator/results/summary.h"
#include "cli/logs.h"
#include "cli/outputs.h"
#include "common/hash.h"
#include "common/name_lock.h"
#include "common/progress_line.h"
#include "common/rank_batch_runner.h"
#include "common/thread_count.h"
#include "umbridge/remote_calibration.h"

namespace plumb {
namespace {

struct Interrupted {};

// Errors of one step, each transition predicted by the others.
void PrintGap(const Gap& gap, const RobotDescription& robot) {
  std::cout << fmt::format("  {:<28}{:>7}{:>12}{:>12}{:>12}{:>12}\n", "error of one step", "steps",
                           "without", "residual", "readings", "explained");
  const auto rows = [&](const char* condition, const ResidualQuality& quality) {
    const Eigen::VectorXd explained = Explained(quality);
    for (Eigen::Index i = 0; i < explained.size(); ++i) {
      const double claimed = quality.claimed(i);
      std::cout << fmt::format("  {:<28}{:>7}{:>12.3g}{:>12.3g}{:>12}{:>10.0f} %\n",
                               robot.joints[static_cast<size_t>(i)].name + ", " + condition,
                               quality.transitions, quality.before(i), quality.after(i),
                               claimed > 0 ? fmt::format("{:.3g}", claimed) : "not said",
                               100 * explained(i));
    }
  };
  if (gap.residual->free) rows("free", gap.free);
  if (gap.residual->touching) rows("touching", gap.touching);
}

void PrintReplay(const ReplayErrors& replay) {
  std::cout << fmt::format(
      "- open-loop replay of what was held out, up to {:.3g} s from its first state: sum over "
      "joints of the mean squared position error {:.3g}, of the prior {:.3g}\n",
      replay.seconds, replay.posterior, replay.prior);
}

void PrintFindings(const Findings& findings, const RobotDescription& robot) {
  const Summary summary = Summarise(findings, robot);
  std::cout << fmt::format("{:24} {:>22} {:>24} {:>25}\n", "", "prior", "posterior", "95 %");
  for (size_t i = 0; i < robot.parameters.size(); ++i) {
    const auto at = static_cast<Eigen::Index>(i);
    const auto number = [](double mean, double sd) {
      const int digits =
          std::clamp(static_cast<int>(1 - std::floor(std::log10(std::max(sd, 1e-12)))), 0, 12);
      return fmt::format("{:.{}f} ± {:.2g}", mean, digits, sd);
    };
    std::cout << fmt::format("{:24} {:>22} {:>24} {:>12.6g} {:>12.6g}\n",
                             robot.parameters[i].name + " [" + robot.parameters[i].unit + "]",
                             number(summary.prior_mean(at), summary.prior_sd(at)),
                             number(summary.mean(at), summary.sd(at)), summary.lower(at),
                             summary.upper(at));
  }
  const auto print = [](const std::string& words) {
    if (!words.empty()) std::cout << "- " << words << "\n";
  };
  print(findings.identifiability.summary), print(findings.advice);
  print(findings.misspecification.summary), print(findings.gap.summary);
  if (findings.gap.residual) PrintGap(findings.gap, robot);
  print(findings.holdout.summary), print(findings.agreement.summary), print(findings.check);
  for (const std::string& warning : findings.warnings) std::cout << "! " << warning << "\n";
  std::cout << fmt::format(
      "{}, {} transitions simulated for the fit and {} for the diagnostics, {} failed; {:.2f} s\n",
      findings.used, findings.simulated_steps, findings.diagnostic_steps, findings.failures,
      findings.seconds);
}

Residuals ResidualsOf(const Findings& findings, const RobotDescription& robot) {
  Residuals residuals{findings.errors, findings.rows, {}};
  for (const char* kind : {"q ", "v "}) {
    for (const JointDescription& joint : robot.joints) {
      const std::vector<std::string> axes = joint.num_velocities() == 1
                                                ? std::vector<std::string>{""}
                                                : std::vector<std::string>{"/x", "/y", "/z"};
      for (const std::string& axis : axes)
        residuals.coordinates.push_back(kind + joint.name + axis);
    }
  }
  return residuals;
}

// All of it: simulations of other data are not taken up.
uint64_t HashOf(const Transition& t, uint64_t identity) {
  identity = Hash(&t.step, sizeof t.step, identity);
  for (const Eigen::VectorXd* x :
       {&t.q, &t.v, &t.next_q, &t.next_v, &t.q_sd, &t.v_sd, &t.next_q_sd, &t.next_v_sd})
    identity = Hash(Eigen::MatrixXd(*x), identity);
  for (const EffortSegment& segment : t.efforts) {
    identity = Hash(&segment.duration, sizeof segment.duration, identity);
    identity = Hash(Eigen::MatrixXd(segment.effort), identity);
  }
  return Hash(t.disturbance, identity);
}

uint64_t CalibrationIdentity(const RobotDescription& robot, const CalibrateFlags& flags,
                             const std::vector<Log>& logs) {
  uint64_t identity = Hash(VersionLine("plumb") + flags.options.method + flags.options.discrepancy,
                           robot.fingerprint);
  identity = Hash(&flags.options.seed, sizeof flags.options.seed, identity);
  identity = Hash(&flags.options.residual, sizeof flags.options.residual, identity);
  identity = Hash(&flags.options.budget, sizeof flags.options.budget, identity);
  identity =
      Hash(flags.options.horizons.data(), flags.options.horizons.size() * sizeof(int), identity);
  for (const Log& log : logs) {
    for (const Rollout& rollout : log.rollouts) {
      const size_t count = rollout.transitions.size();
      identity = Hash(&count, sizeof count, identity);
      for (const Transition& t : rollout.transitions) identity = HashOf(t, identity);
    }
  }
  return identity;
}

int Sbc(const CalibrateFlags& flags, const RobotDescription& robot, const std::vector<Log>& logs,
        ProgressLine& line, const std::function<void()>& look) {
  CalibrationOptions options = flags.options;
  options.method = "laplace", options.horizons = {1};
  const Findings findings = Calibrate(robot, logs, options);
  std::vector<Rollout> rollouts;
  for (const Log& log : logs)
    rollouts.insert(rollouts.end(), log.rollouts.begin(), log.rollouts.end());
  RobotSbcOptions sbc;
  sbc.runs = flags.sbc, sbc.seed = options.seed, sbc.threads = options.execution.threads;
  sbc.progress = [&](double share) { look(), line.Show("simulation-based calibration", share); };
  std::cout << SbcSummary(
                   RunRobotSbc(std::make_shared<Model>(robot), rollouts, findings.noise_sd, sbc))
            << std::endl;
  return 0;
}

// What judges a model needs simulations of ours.
void RequireForRemote(const CalibrateFlags& flags, int ranks) {
  if (flags.options.method != "auto" && flags.options.method != "laplace")
    throw std::invalid_argument("--model is calibrated by laplace: no other --method");
  if (!flags.report.empty() || flags.strict || flags.sbc > 0)
    throw std::invalid_argument("--model excludes --report, --strict and --sbc: nothing judges it");
  if (ranks > 1) throw std::invalid_argument("--model is for one rank");
}

int CalibrateForeign(const CalibrateFlags& flags, const RobotDescription& robot,
                     const std::vector<Log>& logs, const std::string& command) {
  RemoteModel model(flags.model, flags.model_name,
                    static_cast<Eigen::Index>(robot.parameters.size()),
                    NextStatesSize(robot, logs));
  const Findings findings = CalibrateRemote(robot, logs, model, flags.options);
  PrintFindings(findings, robot);
  WritePosterior(flags.output, findings, robot,
                 ProvenanceOf(logs, flags.options, command, std::time(nullptr)));
  const Summary summary = Summarise(findings, robot);
  if (!flags.urdf.empty()) WriteIdentifiedUrdf(flags.urdf, robot, summary.mean, summary.sd);
  std::cout << "wrote " << flags.output << (flags.urdf.empty() ? "" : ", " + flags.urdf)
            << std::endl;
  return 0;
}

}  // namespace

std::string MethodHelp() {
  std::string help = "Methods:";
  for (const Method& method : Methods())
    help += fmt::format("\n  {:<20}{}", method.name, method.help);
  return help;
}

int CalibrateLogs(Process& process, CalibrateFlags flags, const std::string& command) {
  const Ranks ranks;
  const bool speaks = ranks.rank() == 0;
  if (!speaks) spdlog::set_level(spdlog::level::err);
  const RobotDescription robot = LoadRobot(flags.robot);
  const std::string journal_file = flags.output + ".journal";
  if (speaks) {
    std::vector<std::string> inputs = FilesOf(robot);
    inputs.insert(inputs.end(), flags.logs.begin(), flags.logs.end());
    inputs.insert(inputs.end(), flags.tables.begin(), flags.tables.end());
    RequireOutputs({flags.output, flags.report, flags.urdf}, inputs);
    RequireApart({journal_file, flags.report, flags.urdf});
  }
  if (!flags.model.empty()) RequireForRemote(flags, ranks.size());
  flags.options.residual = flags.options.residual && robot.calibration.residual;
  const std::vector<Log> logs = ReadLogs(flags.logs, flags.tables, robot);
  if (speaks) PrintLogs(logs);
  flags.options.execution.threads = ThreadCount(flags.threads, ranks.OnThisMachine().size());
  ProgressLine line(speaks);
  const auto look = [&] {
    if (process.stopping()) throw Interrupted();
  };
  try {
    if (!flags.model.empty()) {
      flags.options.progress = [&](const std::string& what, double share) {
        look(), line.Show(what, share);
      };
      return CalibrateForeign(flags, robot, logs, command);
    }
    if (flags.sbc > 0) return Sbc(flags, robot, logs, line, look);
    std::optional<NameLock> lock;
    std::optional<Journal> journal;
    if (speaks) {
      lock.emplace("journal " + NameOfFile(journal_file),
                   journal_file + ": another process is at work on it: give another --output");
    }
    if (speaks) journal.emplace(journal_file, CalibrationIdentity(robot, flags, logs));
    RankBatchRunner batches(ranks, journal ? &*journal : nullptr);
    flags.options.execution.batches = &batches;
    flags.options.progress = [&](const std::string& what, double share) {
      look(), line.Show(what, share);
    };
    const Findings findings = Calibrate(robot, logs, flags.options);
    if (!speaks) return 0;
    if (journal->resumed() > 0)
      std::cout << fmt::format("went on from {}: {} batches of simulations were there\n",
                               journal_file, journal->resumed());
    PrintFindings(findings, robot);
    if (flags.options.replay) PrintReplay(findings.holdout.replay);
    const Provenance provenance = ProvenanceOf(logs, flags.options, command, std::time(nullptr));
    WritePosterior(flags.output, findings, robot, provenance);
    const Summary summary = Summarise(findings, robot);
    if (!flags.report.empty())
      WriteReport(flags.report, findings, robot, provenance, ResidualsOf(findings, robot));
    if (!flags.urdf.empty())
      WriteIdentifiedUrdf(flags.urdf, robot, summary.mean, summary.sd,
                          findings.gap.residual != nullptr);
    journal->Finish();
    std::cout << "wrote " << flags.output << (flags.report.empty() ? "" : ", " + flags.report)
              << (flags.urdf.empty() ? "" : ", " + flags.urdf) << std::endl;
    return flags.strict && !Trustworthy(findings) ? 3 : 0;
  } catch (const Interrupted&) {
    if (speaks && flags.sbc == 0 && flags.model.empty())
      std::cerr << "\ninterrupted; the same command goes on from " << journal_file << std::endl;
    return 130;
  }
}

}  // namespace plumb
