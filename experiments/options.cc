#include "experiments/options.h"

#include <map>

namespace plumb {

void AddExperimentFlags(CLI::App& app, ExperimentOptions& options, const std::string& files) {
  app.add_option("robots", options.robots, "the folder robots/")->required();
  AddOutputFlag(app, options.output, files);
  AddCountFlag(app, "--runs", options.runs, "seeds, and robots, from 1");
  AddThreadsFlag(app, options.threads);
  app.add_flag("--quick", options.quick, "hardly any training: looks whether it runs");
}

void AddIterationsFlag(CLI::App& app, int& iterations, const std::string& meaning) {
  AddCountFlag(app, "--iterations", iterations, meaning);
}

void AddHiddenFlag(CLI::App& app, Hidden& hidden) {
  const std::map<std::string, Hidden> names{{Key(Hidden::kPaper), Hidden::kPaper},
                                            {Key(Hidden::kGym), Hidden::kGym},
                                            {Key(Hidden::kPrior), Hidden::kPrior}};
  app.add_option(
         "--hidden", hidden,
         "where the robot's parameters are drawn from: the paper's ranges (the hopper's five "
         "masses 1 to 5 kg), gym's four masses 16 % more or less, or the whole prior")
      ->transform(CLI::CheckedTransformer(names, CLI::ignore_case))
      ->default_str("paper");
}

void AddOutputFlag(CLI::App& app, std::string& output, const std::string& files) {
  app.add_option("--output", output, "folder for " + files)->capture_default_str();
}

void AddCountFlag(CLI::App& app, const std::string& flag, int& count, const std::string& meaning) {
  app.add_option(flag, count, meaning)->check(CLI::Range(1, 1000))->capture_default_str();
}

void AddThreadsFlag(CLI::App& app, int& threads) {
  app.add_option("--threads", threads, "0 = one per core; the result does not depend on it")
      ->check(CLI::Range(0, 1024));
}

}  // namespace plumb
