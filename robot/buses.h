#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "common/config.h"

namespace plumb {

/// A CAN bus of a robot. Functions here are thread-safe.
struct BusDescription {
  /// letters, digits, '_' and '-'; empty: the robot's only bus, which needs no name
  std::string name = {};
  std::string url = {};      ///< see OpenTransport
  double bit_rate = 1e6;     ///< [bit/s]
  double data_bit_rate = 0;  ///< [bit/s] of the data of CAN FD frames; 0 = it carries none

  /// In a sentence: "the bus", or "bus left".
  std::string Label() const;
};

/// The table [bus], or [[bus]] for each of several, which then have names. No two have one name or
/// one URL. @throws ConfigError
std::vector<BusDescription> ReadBuses(Config& root);

/// Of a joint or a sensor: which of the buses its key `bus` names. Where there is only one the key
/// may be missing. @return its index. @throws ConfigError
size_t ReadBusOf(Config& config, const std::vector<BusDescription>& buses);

/// An error in the table of one of the buses, at `key`.
[[noreturn]] void FailAtBus(Config& root, size_t bus, const std::string& key,
                            const std::string& what);

/// What --bus has said: the URL of the only bus, or NAME=URL of one of them. The others keep
/// theirs. @throws std::invalid_argument, one line, if that is not one of the buses, or two of them
/// would have one URL.
void SetUrls(std::vector<BusDescription>& buses, const std::vector<std::string>& flags);

/// The same of all the buses, as --bus has it: "udp:239.74.163.2:43113", "left=socketcan:can0".
std::vector<std::string> UrlsOf(const std::vector<BusDescription>& buses);

/// Those in one line: by this text the buses of a run are known to others.
std::string InOneLine(const std::vector<BusDescription>& buses);

/// The bus behind the faults of "faulty:FAULTS:URL".
std::string InnermostBus(std::string url);

}  // namespace plumb
