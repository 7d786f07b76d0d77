#pragma once

#include <string>

namespace plumb {

/// The flags of `plumb export`.
struct ExportFlags {
  std::string log;
  std::string mcap;   ///< file to write; empty = none
  std::string csv;    ///< folder to write; empty = none
  std::string robot;  ///< folder or TOML file; empty = the one beside the log, if there is one
};

/// `plumb export`: what a log has, for other tools. @return exit status. Not thread-safe.
/// @throws std::runtime_error or std::invalid_argument, one line for people, naming the file: a log
/// that cannot be read or is damaged, an output that is an input or cannot be written.
int Export(const ExportFlags& flags);

}  // namespace plumb
