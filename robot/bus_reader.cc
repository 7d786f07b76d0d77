// Of buses.h: what robot.toml and --bus say of them.

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <stdexcept>
#include <string_view>

#include "robot/buses.h"

namespace plumb {
namespace {

constexpr size_t kMostBuses = 16;  // each has a socket, and frames for its flight recorder

std::vector<Config> BusTables(Config& root) {
  if (root.Has("bus") && !root.IsTable("bus")) return root.Tables("bus");
  std::vector<Config> one;
  one.push_back(root.Table("bus"));
  return one;
}

bool IsName(const std::string& text) {
  constexpr std::string_view kLetters =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789_-";
  return !text.empty() && text.find_first_not_of(kLetters) == std::string::npos;
}

/// What is wrong with a URL that is a name alone, as `ip link` has it; empty: nothing.
std::string SchemeFault(const std::string& url) {
  if (url.find(':') != std::string::npos) return "";
  return fmt::format("does not say which kind of bus it is: write socketcan:{}",
                     url.empty() ? "can0" : url);
}

/// The switch that people look for.
void RefuseFdSwitch(const Config& table) {
  for (const std::string& key : table.Keys()) {
    if (key != "fd" && key != "canfd" && key != "can_fd") continue;
    table.Fail(key,
               "is not a known key: a bus carries CAN FD where it has data_bit_rate, [bit/s] of "
               "the data");
  }
}

std::string Names(const std::vector<BusDescription>& buses) {
  std::vector<std::string> names;
  names.reserve(buses.size());
  for (const BusDescription& bus : buses) names.push_back(bus.name);
  return fmt::format("{}", fmt::join(names, ", "));
}

/// The one before `buses[index]` that is the same bus, faulty or not; null: none is.
const BusDescription* SameBefore(const std::vector<BusDescription>& buses, size_t index) {
  const auto last = buses.begin() + static_cast<std::ptrdiff_t>(index);
  const auto same = std::find_if(buses.begin(), last, [&](const BusDescription& bus) {
    return InnermostBus(bus.url) == InnermostBus(last->url);
  });
  return same == last ? nullptr : &*same;
}

}  // namespace

std::vector<BusDescription> ReadBuses(Config& root) {
  std::vector<Config> tables = BusTables(root);
  if (tables.size() > kMostBuses)
    tables[kMostBuses].Fail("name", fmt::format("is one too many: {} buses at most", kMostBuses));
  std::vector<BusDescription> buses;
  for (Config& table : tables) {
    BusDescription bus;
    if (tables.size() > 1 || table.Has("name")) {
      bus.name = table.String("name");
      if (!IsName(bus.name)) {
        table.Fail("name",
                   fmt::format("= \"{}\" is not of letters, digits, _ and - alone", bus.name));
      }
    }
    for (const BusDescription& other : buses) {
      if (other.name == bus.name)
        table.Fail("name", fmt::format("= \"{}\" occurs twice", bus.name));
    }
    bus.url = table.String("url");
    if (const std::string fault = SchemeFault(bus.url); !fault.empty())
      table.Fail("url", fmt::format("= \"{}\" {}", bus.url, fault));
    bus.bit_rate = table.Number("bit_rate", {1e4, 1e6}, bus.bit_rate);
    if (table.Has("data_bit_rate"))
      bus.data_bit_rate = table.Number("data_bit_rate", {bus.bit_rate, 8e6});
    RefuseFdSwitch(table);
    table.Finish();
    buses.push_back(bus);
    if (const BusDescription* same = SameBefore(buses, buses.size() - 1))
      table.Fail("url", fmt::format("= \"{}\" is also {}'s", bus.url, same->Label()));
  }
  return buses;
}

size_t ReadBusOf(Config& config, const std::vector<BusDescription>& buses) {
  if (!config.Has("bus")) {
    if (buses.size() == 1) return 0;
    config.Fail("bus", "is missing: the robot has several, " + Names(buses));
  }
  const std::string name = config.String("bus");
  const auto bus = std::ranges::find(buses, name, &BusDescription::name);
  if (bus == buses.end() || name.empty()) {
    config.Fail("bus",
                buses[0].name.empty()
                    ? fmt::format("= \"{}\", but the robot has one bus, without a name", name)
                    : fmt::format("= \"{}\" is none of the buses {}", name, Names(buses)));
  }
  return static_cast<size_t>(bus - buses.begin());
}

void FailAtBus(Config& root, size_t bus, const std::string& key, const std::string& what) {
  BusTables(root)[bus].Fail(key, what);
}

void SetUrls(std::vector<BusDescription>& buses, const std::vector<std::string>& flags) {
  for (const std::string& flag : flags) {
    // A URL may have '=' in it, but behind the ':' of its scheme.
    const size_t equals = flag.find('=');
    const bool named = equals < flag.find(':');
    if (!named && buses.size() > 1) {
      throw std::invalid_argument(fmt::format(
          "--bus {}: the robot has several buses ({}): --bus NAME=URL", flag, Names(buses)));
    }
    const auto bus = named ? std::ranges::find(buses, flag.substr(0, equals), &BusDescription::name)
                           : buses.begin();
    if (bus == buses.end()) {
      throw std::invalid_argument(
          fmt::format("--bus {}: no bus of the robot has that name{}", flag,
                      buses[0].name.empty() ? ": --bus URL" : "; there are: " + Names(buses)));
    }
    bus->url = named ? flag.substr(equals + 1) : flag;
    if (const std::string fault = SchemeFault(bus->url); !fault.empty())
      throw std::invalid_argument(fmt::format("--bus {}: {}", flag, fault));
  }
  for (size_t i = 0; i < buses.size(); ++i) {
    if (const BusDescription* same = SameBefore(buses, i)) {
      throw std::invalid_argument(
          fmt::format("--bus: {} and {} are both {}", same->name, buses[i].name, buses[i].url));
    }
  }
}

}  // namespace plumb
