#pragma once

#include <CLI/CLI.hpp>
#include <string>

#include "experiments/recording.h"

namespace plumb {

/// The settings that experiments share, each with its flag.
struct ExperimentOptions {
  std::string robots, output = ".";
  int runs = 5;         ///< seeds, and robots, from 1
  int iterations = 10;  ///< of SimOpt
  int threads = 0;      ///< 0 = one per core; the result does not depend on it
  Hidden hidden = Hidden::kPaper;
  bool quick = false;  ///< hardly any work: looks whether it runs
};

/// ROBOTS, --output, --runs, --threads and --quick. @param files that are written, for people.
void AddExperimentFlags(CLI::App& app, ExperimentOptions& options, const std::string& files);

/// --iterations. @param meaning for people.
void AddIterationsFlag(CLI::App& app, int& iterations, const std::string& meaning = "of SimOpt");
/// --hidden: where the robot's parameters are drawn from.
void AddHiddenFlag(CLI::App& app, Hidden& hidden);

/// --output alone.
void AddOutputFlag(CLI::App& app, std::string& output, const std::string& files);
/// A flag that counts seeds or runs, 1 to 1000.
void AddCountFlag(CLI::App& app, const std::string& flag, int& count, const std::string& meaning);
/// --threads alone.
void AddThreadsFlag(CLI::App& app, int& threads);

}  // namespace plumb
