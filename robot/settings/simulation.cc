#include "robot/settings/simulation.h"

#include <fmt/format.h>

#include <cmath>
#include <limits>

#include "robot/settings/ranges.h"

namespace plumb {
namespace {

constexpr size_t kMostPairTables = 1000;

// Gravity may be left out; of a table that is there, nothing may.
World ReadWorld(Config& simulation, Config& contact, Config& limit,
                const SimulationSettings& settings) {
  using Table = WorldParameterKind::Table;
  World world;
  for (const WorldParameterKind& kind : kWorldParameterKinds) {
    if (!settings.Has(kind.table)) continue;
    Config& table = kind.table == Table::kContact ? contact
                    : kind.table == Table::kLimit ? limit
                                                  : simulation;
    const bool optional = kind.table == Table::kSimulation;
    kind.of(world) = optional ? table.Number(kind.key, kind.in_file, kind.of(world))
                              : table.Number(kind.key, kind.in_file);
  }
  return world;
}

std::vector<SimulationSettings::LinkPair> ReadLinkPairs(Config& contact) {
  std::vector<SimulationSettings::LinkPair> pairs;
  for (Config& pair : contact.Tables("pair")) {
    const std::vector<std::string> links = pair.Strings("links");
    if (links.size() != 2) pair.Fail("links", "must name two links that touch each other");
    pairs.push_back({links[0], links[1], pair.Position("links")});
    pair.Finish();
    if (pairs.size() > kMostPairTables)
      pair.Fail("links", fmt::format("is one of more than {}", kMostPairTables));
  }
  return pairs;
}

}  // namespace

bool SimulationSettings::Has(WorldParameterKind::Table table) const {
  switch (table) {
    case WorldParameterKind::Table::kContact:
      return contact.has_value();
    case WorldParameterKind::Table::kLimit:
      return stop.has_value();
    default:
      return true;
  }
}

void SimulationSettings::set_world(const World& world) {
  gravity = world.gravity;
  if (contact) contact = world.contact;
  if (stop) stop = world.stop;
}

SimulationSettings ReadSimulation(Config config, double period) {
  SimulationSettings s;
  s.integrator = config.Choice("integrator", {"semi-implicit", "leapfrog"}) == 0
                     ? SimulationSettings::Integrator::kSemiImplicit
                     : SimulationSettings::Integrator::kLeapfrog;
  s.substep = config.Number("substep", {1e-6, 1});
  s.latency = config.Number("latency", kSaneNotNegative, 0);
  s.speed_clip = config.Number("speed_clip", {std::numeric_limits<double>::min()}, HUGE_VAL);
  s.move_before_clip = config.Boolean("move_before_clip", false);
  if (s.substep > period * (1 + 1e-9))
    config.Fail("substep", "must not be longer than task.period");
  if (s.latency >= period) config.Fail("latency", "must be shorter than task.period");
  if (config.Has("contact")) s.contact.emplace();
  if (config.Has("limit")) s.stop.emplace();
  Config contact = config.Table("contact", false), limit = config.Table("limit", false);
  s.set_world(ReadWorld(config, contact, limit, s));
  s.link_pairs = ReadLinkPairs(contact);
  s.meshes = contact.Boolean("meshes", true);
  contact.Finish();
  limit.Finish();
  config.Finish();
  return s;
}

}  // namespace plumb
