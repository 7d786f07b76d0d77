#include "chaos/script.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "common/random.h"
#include "common/time_units.h"

namespace plumb {
namespace {

constexpr uint32_t kScriptStream = 0x53637269;  // "Scri"

struct Hearing {
  const char* who;
  const char* topic;
};

// Who listens to what, but for what only robots with an IMU have.
constexpr std::array kHearings{
    Hearing{"plumb-driver", "JOINT_COMMAND"},
    Hearing{"plumb-driver", kBus},
    Hearing{"plumb-robot", kBus},
    Hearing{"plumb-robot", "PLACE_ROBOT"},
    Hearing{"plumb-estimator", "JOINT_STATE"},
    Hearing{"plumb-controller", "ROBOT_STATE"},
    Hearing{"plumb-controller", "DRIVER_STATUS"},
    Hearing{"plumb-controller", "POLICY"},
    Hearing{"plumb-calibrator", "ROBOT_STATE_SMOOTHED"},
    Hearing{"plumb-calibrator", "JOINT_COMMAND"},
    Hearing{"plumb-calibrator", "CONTROLLER_STATUS"},
    Hearing{"plumb-trainer", "PARAMETER_DISTRIBUTION"},
    Hearing{"plumb-trainer", "CONTROLLER_STATUS"},
};

constexpr Hearing kImuHearing{"plumb-estimator", "IMU"};

template <size_t count>
const Hearing& Pick(const std::array<Hearing, count>& hearings, bool imu, Random& random) {
  const size_t i = random.Below(count + (imu ? 1 : 0));
  return i < count ? hearings[i] : kImuHearing;
}

struct Kind {
  Mischief what;
  int weight;                // how often, among all
  double shortest, longest;  // [s] of its duration, log-uniform
};

// What stops the robot is rarer than what only tries to: in a run that is always stopped nothing
// is calibrated.
constexpr std::array kKinds{
    Kind{Mischief::kKill, 6, 0.02, 0.6},    Kind{Mischief::kStall, 6, 0.005, 0.6},
    Kind{Mischief::kDrop, 10, 0.005, 0.2},  Kind{Mischief::kDelay, 10, 0.005, 0.2},
    Kind{Mischief::kDouble, 10, 0.01, 0.5}, Kind{Mischief::kCorrupt, 8, 0.005, 0.1},
    Kind{Mischief::kReplay, 10, 0, 0},      Kind{Mischief::kMadden, 8, 0.01, 0.4},
    Kind{Mischief::kGarbage, 10, 0, 0},     Kind{Mischief::kForge, 10, 0, 0},
    Kind{Mischief::kForgeFrame, 4, 0, 0},   Kind{Mischief::kBusDown, 2, 0.005, 0.3},
    Kind{Mischief::kDiskFull, 5, 0.1, 2.0}, Kind{Mischief::kSetClock, 3, 0.05, 1.0},
    Kind{Mischief::kStop, 2, 0, 0},
};
static_assert(kKinds.size() == kMischiefs);

double LogUniform(Random& random, double lower, double upper) {
  return std::exp(random.Uniform(std::log(lower), std::log(upper)));
}

const Kind& PickKind(Random& random) {
  int all = 0;
  for (const Kind& kind : kKinds) all += kind.weight;
  int left = static_cast<int>(random.Below(static_cast<size_t>(all)));
  return *std::ranges::find_if(kKinds, [&](const Kind& kind) { return (left -= kind.weight) < 0; });
}

void PickVictim(Random& random, bool imu, Prank& prank) {
  const std::vector<std::string> names = ProcessNames();
  switch (prank.what) {
    case Mischief::kDrop:
    case Mischief::kDelay:
    case Mischief::kDouble:
    case Mischief::kCorrupt: {
      const Hearing& hearing = Pick(kHearings, imu, random);
      prank.whom = hearing.who;
      prank.topic = hearing.topic;
      return;
    }
    case Mischief::kMadden: {  // the fast loop, whose messages are many
      constexpr std::array<Hearing, 6> kTrusting{{{"plumb-driver", "JOINT_COMMAND"},
                                                  {"plumb-driver", "JOINT_COMMAND"},
                                                  {"plumb-estimator", "JOINT_STATE"},
                                                  {"plumb-controller", "ROBOT_STATE"},
                                                  {"plumb-controller", "POLICY"},
                                                  {"plumb-calibrator", "ROBOT_STATE_SMOOTHED"}}};
      const Hearing& hearing = Pick(kTrusting, imu, random);
      prank.whom = hearing.who;
      prank.topic = hearing.topic;
      return;
    }
    case Mischief::kReplay:
    case Mischief::kForge:
    case Mischief::kGarbage: {
      const Hearing& hearing = Pick(kHearings, imu, random);
      prank.topic = prank.what == Mischief::kGarbage || hearing.topic != std::string(kBus)
                        ? hearing.topic
                        : "DRIVER_REQUEST";
      return;
    }
    case Mischief::kForgeFrame:
    case Mischief::kBusDown:
      prank.topic = kBus;
      return;
    case Mischief::kStop:
      prank.topic = "DRIVER_REQUEST";
      return;
    case Mischief::kDiskFull: {  // those who write
      constexpr std::array kWriters{"plumb-driver", "plumb-calibrator", "plumb-calibrator",
                                    "plumb-trainer"};
      prank.whom = kWriters[random.Below(kWriters.size())];
      return;
    }
    case Mischief::kKill:
    case Mischief::kStall:
    case Mischief::kSetClock:
      prank.whom = names[random.Below(names.size())];
      return;
  }
}

double PickAmount(Random& random, Mischief what) {
  switch (what) {
    case Mischief::kDelay:
      return LogUniform(random, 1e3, 3e5);
    case Mischief::kDiskFull:
      return random.Uniform() < 0.5 ? 0 : std::floor(LogUniform(random, 10, 1e5));
    case Mischief::kSetClock:
      return (random.Uniform() < 0.5 ? -1 : 1) * LogUniform(random, 1e4, 3.6e9);
    default:
      return random.Uniform() < 0.3 ? 1 : LogUniform(random, 0.05, 1);
  }
}

const char* Name(Mischief what) {
  constexpr std::array kNames{"kills",
                              "stalls",
                              "drops",
                              "delays",
                              "doubles",
                              "corrupts",
                              "replays",
                              "maddens",
                              "says garbage on",
                              "forges",
                              "forges a frame on",
                              "takes down",
                              "fills the disk of",
                              "sets the clock of",
                              "stops the robot by"};
  return kNames[static_cast<size_t>(what)];
}

}  // namespace

std::vector<std::string> ProcessNames() {
  return {"plumb-robot",      "plumb-driver",     "plumb-estimator",
          "plumb-controller", "plumb-calibrator", "plumb-trainer"};
}

std::vector<Prank> MakeScript(uint64_t seed, int count, int64_t span, bool imu) {
  Random random(seed, {kScriptStream});
  std::vector<Prank> script(static_cast<size_t>(count));
  for (Prank& prank : script) {
    prank.time = static_cast<int64_t>(random.Uniform() * static_cast<double>(span));
    const Kind& kind = PickKind(random);
    prank.what = kind.what;
    if (kind.longest > 0)
      prank.duration = Microseconds(LogUniform(random, kind.shortest, kind.longest));
    PickVictim(random, imu, prank);
    prank.amount = PickAmount(random, prank.what);
  }
  std::ranges::stable_sort(script, {}, &Prank::time);
  for (uint32_t i = 0; i < script.size(); ++i) script[i].number = i;
  return script;
}

std::string Describe(const Prank& prank) {
  std::string text = fmt::format("{:.6f} s: {}", Seconds(prank.time), Name(prank.what));
  switch (prank.what) {
    case Mischief::kDrop:
    case Mischief::kDouble:
    case Mischief::kCorrupt:
    case Mischief::kMadden:
      text += fmt::format(" {:.0f} % of", 100 * prank.amount);
      break;
    case Mischief::kDiskFull:
      text += fmt::format(" (files of {:.0f} bytes)", prank.amount);
      break;
    case Mischief::kDelay:
    case Mischief::kSetClock:
      text += fmt::format(" by up to {:.6f} s", prank.amount * 1e-6);
      break;
    default:
      break;
  }
  if (!prank.topic.empty()) text += " " + prank.topic;
  if (!prank.whom.empty()) text += (prank.topic.empty() ? " " : " to ") + prank.whom;
  if (prank.duration > 0) text += fmt::format(" for {:.6f} s", Seconds(prank.duration));
  return text;
}

}  // namespace plumb
