// How punctual the driver's cycle and the whole chain are on this machine, and the floor beneath
// them: bare timers and bare LCM. One Markdown table, for docs/measurements/drivers.md.

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cmath>
#include <exception>
#include <thread>

#include "bench/realtime/chain.h"
#include "bench/realtime/floor.h"

namespace plumb {
namespace {

constexpr int kPriority = 80;
constexpr std::array kShares = {0.5, 0.99, 0.999};

void Row(const std::string& what, int priority, int load, size_t count, const std::string& times,
         const std::string& notes) {
  fmt::print("| {} | {} | {} | {} | {} | {} |\n", what,
             priority > 0 ? fmt::format("FIFO {}", priority) : "OTHER",
             load > 0 ? "cores loaded" : "alone", count, times, notes);
  std::fflush(stdout);
}

/// "p50 | p99 | p99.9 | max" [us].
std::string Quantiles(Times times) {
  if (times.empty()) return "- | - | - | -";
  std::ranges::sort(times);
  std::string text;
  for (const double share : kShares) {
    text += fmt::format(
        "{} | ",
        times[static_cast<size_t>(std::ceil(share * static_cast<double>(times.size()))) - 1]);
  }
  return text + std::to_string(times.back());
}

/// The same of a histogram, whose bins tell only below what power of two a time was.
std::string Quantiles(const std::vector<int64_t>& bins, int64_t total) {
  std::string text;
  const auto below = [&](double count) {
    double seen = 0;
    for (size_t i = 0; i < bins.size(); ++i) {
      seen += static_cast<double>(bins[i]);
      if (seen >= count)
        return i + 1 == bins.size() ? fmt::format("> {}", int64_t{1} << i)
                                    : fmt::format("< {}", int64_t{2} << i);
    }
    return std::string("-");
  };
  for (const double share : kShares) text += below(share * static_cast<double>(total)) + " | ";
  return text + below(static_cast<double>(total));
}

int64_t Overruns(const Times& lateness) {
  return std::ranges::count_if(lateness, [](int64_t late) { return late >= 1000; });
}

void MeasureFloor(double seconds, int priority, int load) {
  const Load burning(load);
  const Realtime realtime(priority);
  const Times timer = BareTimer(seconds);
  Row("bare timer: lateness", priority, load, timer.size(), Quantiles(timer),
      fmt::format("{} overruns", Overruns(timer)));
  const Times round =
      BarePingPong(seconds, "udpm://239.255.76.67:17691?ttl=0&recv_buf_size=2097152");
  Row("bare LCM: there and back", priority, load, round.size(), Quantiles(round), "");
}

void MeasureOne(const std::string& source, const std::string& binaries, ChainRobot robot,
                const std::string& which, double seconds, int priority, int load) {
  const ChainTimes chain = MeasureChain(source, binaries, robot, seconds, priority, load);
  const std::string stops =
      chain.stops == 0 ? ""
                       : fmt::format(", stopped {} times, last: {}", chain.stops, chain.reason);
  Row("driver's cycle: lateness" + which, priority, load, static_cast<size_t>(chain.cycles),
      Quantiles(chain.lateness, chain.cycles), fmt::format("{} overruns{}", chain.overruns, stops));
  Row("encoder frame to torque frame" + which, priority, load, chain.answers.size(),
      Quantiles(chain.answers),
      fmt::format("{} of {} commands superseded", chain.superseded, chain.commands));
}

void MeasureAll(const std::string& source, const std::string& binaries, double seconds,
                double floor_seconds, int priority, int load) {
  MeasureFloor(floor_seconds, priority, load);
  MeasureOne(source, binaries, ChainRobot::kPendulum, "", seconds, priority, load);
  MeasureOne(source, binaries, ChainRobot::kLegs, ", twelve drives on four buses at 500 Hz",
             seconds, priority, load);
}

}  // namespace
}  // namespace plumb

int main(int argc, char** argv) {
  double seconds = 60, floor_seconds = 20;
  std::string source = PLUMBLINE_SOURCE, binaries = PLUMBLINE_BINARIES;
  CLI::App app(
      "Measures how punctual this machine, the driver and the whole chain are, and prints a "
      "Markdown table");
  app.add_option("--seconds", seconds, "of each measurement of the chain; there are eight")
      ->check(CLI::Range(1., 3600.))
      ->capture_default_str();
  app.add_option("--floor-seconds", floor_seconds,
                 "of each measurement of timers and LCM; there are eight")
      ->check(CLI::Range(1., 3600.))
      ->capture_default_str();
  app.add_option("--source", source, "folder with robots/")->capture_default_str();
  app.add_option("--binaries", binaries, "folder with plumb-driver and the others")
      ->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  const int cores = static_cast<int>(std::thread::hardware_concurrency());
  fmt::print(
      "| {} s of the chain, {} s of the floor, 1 kHz, times in us | driver's scheduling | machine, "
      "{} cores | n | p50 | p99 | p99.9 | "
      "max | |\n"
      "|---|---|---|---|---|---|---|---|---|\n",
      seconds, floor_seconds, cores);
  try {
    for (const int load : {0, cores}) {
      for (const int priority : {0, plumb::kPriority})
        plumb::MeasureAll(source, binaries, seconds, floor_seconds, priority, load);
    }
  } catch (const std::exception& error) {
    fmt::print(stderr, "{}\n", error.what());
    return 1;
  }
  return 0;
}
