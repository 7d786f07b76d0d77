#pragma once

#include <string>
#include <vector>

#include "robot/description.h"
#include "sim/episode.h"

namespace plumb {

/// "3 episodes, 396 steps, mean return 129.5, standard deviation 1.2". Episodes whose simulation
/// failed have no return: they are counted apart.
std::string Totals(const std::vector<EpisodeSummary>& episodes);

/// The table's head: t, q/<joint>, v/<joint>, u/<driven joint>, reward, terminated, truncated. A
/// spherical joint has /w, /x, /y, /z in q and /x, /y, /z in v.
std::string CsvHeader(const RobotDescription& robot);
/// A row of it, 17 significant digits. Appends.
void AppendCsv(const SimulatedStep& step, std::string& csv);

}  // namespace plumb
