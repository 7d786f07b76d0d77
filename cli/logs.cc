#include "cli/logs.h"

#include <fmt/format.h>

#include <iostream>
#include <stdexcept>

#include "calibrator/motion/csv_log.h"
#include "calibrator/motion/lcm_log.h"

namespace plumb {

std::vector<Log> ReadLogs(const std::vector<std::string>& logs,
                          const std::vector<std::string>& tables, const RobotDescription& robot) {
  if (logs.empty() && tables.empty())
    throw std::invalid_argument("there is no motion: give a --log or a --csv");
  std::vector<Log> read;
  read.reserve(logs.size() + tables.size());
  for (const std::string& file : logs) read.push_back(ReadLcmLog(file, robot));
  for (const std::string& file : tables) read.push_back(ReadCsvLog(file, robot));
  return read;
}

void PrintLogs(const std::vector<Log>& logs) {
  for (const Log& log : logs) {
    std::cout << fmt::format("{}: {} transitions in {} roll-out{}", log.name,
                             CountTransitions(log.rollouts), log.rollouts.size(),
                             log.rollouts.size() == 1 ? "" : "s");
    if (log.drops.total() > 0) {
      std::cout << "; dropped: " << log.drops.summary();
    }
    std::cout << "\n";
    for (const std::string& warning : log.warnings) std::cout << "  " << warning << "\n";
  }
}

}  // namespace plumb
