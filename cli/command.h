#pragma once

#include <CLI/CLI.hpp>
#include <memory>
#include <string>
#include <utility>

#include "cli/commands.h"

namespace plumb {

/// A command that hears plumb's own options, too, wherever they stand. Not thread-safe.
inline CLI::App* AddCommand(CLI::App& app, const std::string& name, const std::string& words) {
  return app.add_subcommand(name, words)->fallthrough();
}

/// Once the command is given, that is what is to be done. Not thread-safe.
inline void SetAction(CLI::App& command, Action& action, Action does) {
  command.final_callback([&action, does = std::move(does)] { action = does; });
}

}  // namespace plumb
