#include "cli/calibrate.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <cmath>
#include <ctime>
#include <filesystem>
#include <iostream>
#include <optional>
#include <stdexcept>
#include <utility>

#include "calibrator/report/report.h"
#include "calibrator/results/identified_urdf.h"
#include "calibrator/results/posterior_file.h"
#include "calibrator/results/summary.h"
#include "cli/calibrate_sbc.h"
#include "cli/logs.h"
#include "cli/outputs.h"
#include "common/hash.h"
#include "common/name_lock.h"
#include "common/progress_line.h"
#include "common/rank_batch_runner.h"
#include "common/thread_count.h"
#include "robot/coordinate_names.h"
#include "umbridge/remote_calibration.h"

namespace plumb {
namespace {

struct Interrupted {};

// Errors of one step, each transition predicted by the others.
void PrintGap(const Gap& gap, const RobotDescription& robot) {
  std::cout << fmt::format("  {:<28}{:>7}{:>12}{:>12}{:>12}{:>12}\n", "error of one step", "steps",
                           "without", "residual", "readings", "explained");
  const std::vector<std::string> names = CoordinateNames(robot).v;
  const auto rows = [&](const char* condition, const ResidualQuality& quality) {
    const Eigen::VectorXd explained = Explained(quality);
    for (Eigen::Index i = 0; i < explained.size(); ++i) {
      const double claimed = quality.claimed(i);
      std::cout << fmt::format("  {:<28}{:>7}{:>12.3g}{:>12.3g}{:>12}{:>10.0f} %\n",
                               names[static_cast<size_t>(i)] + ", " + condition,
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
    for (const std::string& name : CoordinateNames(robot).v)
      residuals.coordinates.push_back(kind + name);
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

/// The three ways to calibrate, and what they begin with.
class CalibrateCommand {
 public:
  CalibrateCommand(Process& process, CalibrateFlags flags, const std::string& command)
      : process_(process),
        command_(command),
        flags_(std::move(flags)),
        robot_(LoadRobot(flags_.robot)),
        journal_file_(flags_.output + ".journal"),
        line_(speaks()) {
    if (!speaks()) spdlog::set_level(spdlog::level::err);
    if (ranks_.size() > 1 && (foreign() || judges())) {
      if (!speaks()) spdlog::set_level(spdlog::level::off);  // the first says it
      throw std::invalid_argument("--model and --sbc are for one rank");
    }
    if (speaks() && !judges()) RequireFiles();
    RequireDiscrepancy(flags_.options.discrepancy);
    flags_.options.residual = flags_.options.residual && robot_.calibration.residual;
    logs_ = ReadLogs(flags_.logs, flags_.tables, robot_);
    if (speaks()) PrintLogs(logs_);
    flags_.options.execution.threads = ThreadCount(flags_.threads, ranks_.OnThisMachine().size());
    flags_.options.progress = [this](const std::string& what, double share) {
      Look();
      line_.Show(what, share);
    };
  }

  int Run() {
    try {
      if (foreign()) return CalibrateForeign();
      if (judges())
        return JudgePosteriors(robot_, logs_, flags_.options, flags_.sbc, flags_.strict);
      return CalibrateOurs();
    } catch (const Interrupted&) {
      if (speaks() && !foreign() && !judges())
        std::cerr << "\ninterrupted; the same command goes on from " << journal_file_ << std::endl;
      throw;
    }
  }

 private:
  bool speaks() const { return ranks_.rank() == 0; }
  bool foreign() const { return !flags_.model.empty(); }
  bool judges() const { return flags_.sbc > 0; }

  void Look() {
    if (process_.stopping()) throw Interrupted();
  }

  void RequireFiles() const {
    std::vector<std::string> inputs = FilesOf(robot_);
    inputs.insert(inputs.end(), flags_.logs.begin(), flags_.logs.end());
    inputs.insert(inputs.end(), flags_.tables.begin(), flags_.tables.end());
    RequireOutputs({flags_.output, flags_.report, flags_.urdf}, inputs);
    RequireApart({journal_file_, flags_.report, flags_.urdf});
  }

  int CalibrateOurs() {
    std::optional<NameLock> lock;
    std::optional<Journal> journal;
    if (speaks()) {
      lock.emplace("journal " + NameOfFile(journal_file_),
                   journal_file_ + ": another process is at work on it: give another --output");
      journal.emplace(journal_file_, CalibrationIdentity(robot_, flags_, logs_));
    }
    RankBatchRunner batches(ranks_, journal ? &*journal : nullptr);
    flags_.options.execution.batches = &batches;
    const Findings findings = Calibrate(robot_, logs_, flags_.options);
    if (!speaks()) return 0;
    if (journal->resumed() > 0)
      std::cout << fmt::format("went on from {}: {} batches of simulations were there\n",
                               journal_file_, journal->resumed());
    PrintFindings(findings, robot_);
    if (flags_.options.replay) PrintReplay(findings.holdout.replay);
    Write(findings);
    journal->Finish();
    PrintWritten();
    return flags_.strict && !Trustworthy(findings) ? 3 : 0;
  }

  int CalibrateForeign() {
    RemoteModel model(flags_.model, flags_.model_name,
                      static_cast<Eigen::Index>(robot_.parameters.size()),
                      NextStatesSize(robot_, logs_), [this] { Look(); });
    const Findings findings = CalibrateRemote(robot_, logs_, model, flags_.options);
    PrintFindings(findings, robot_);
    Write(findings);
    PrintWritten();
    return 0;
  }

  void Write(const Findings& findings) const {
    const Provenance provenance = ProvenanceOf(logs_, flags_.options, command_, std::time(nullptr));
    WritePosterior(flags_.output, findings, robot_, provenance);
    if (!flags_.report.empty())
      WriteReport(flags_.report, findings, robot_, provenance, ResidualsOf(findings, robot_));
    const Summary summary = Summarise(findings, robot_);
    if (!flags_.urdf.empty())
      WriteIdentifiedUrdf(flags_.urdf, robot_, summary.mean, summary.sd,
                          findings.gap.residual != nullptr);
  }

  void PrintWritten() const {
    std::cout << "wrote " << flags_.output << (flags_.report.empty() ? "" : ", " + flags_.report)
              << (flags_.urdf.empty() ? "" : ", " + flags_.urdf) << std::endl;
  }

  Process& process_;
  const std::string& command_;
  const Ranks ranks_;
  CalibrateFlags flags_;
  const RobotDescription robot_;
  const std::string journal_file_;
  ProgressLine line_;
  std::vector<Log> logs_;
};

}  // namespace

std::string MethodHelp() {
  std::string help = "Methods:";
  for (const Method& method : Methods())
    help += fmt::format("\n  {:<20}{}", method.name, method.help);
  return help;
}

int CalibrateLogs(Process& process, CalibrateFlags flags, const std::string& command) {
  try {
    return CalibrateCommand(process, std::move(flags), command).Run();
  } catch (const Interrupted&) {  // its ranks have said no farewell: mpirun ends the others
    return 130;
  }
}

}  // namespace plumb
