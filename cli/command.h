#pragma once

#include <CLI/CLI.hpp>
#include <functional>
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
/// @param objection why its options make no sense together, for people; empty = they do.
inline void SetAction(
    CLI::App& command, Action& action, Action does,
    std::function<std::string()> objection = [] { return std::string(); }) {
  command.final_callback([&action, does = std::move(does), objection = std::move(objection)] {
    if (const std::string why = objection(); !why.empty()) throw CLI::ValidationError(why);
    action = does;
  });
}

/// The same for what does not look whether it is to stop, and writes its files atomically: a stop
/// signal ends the process at once.
inline void SetAction(CLI::App& command, Action& action, std::function<int()> does) {
  SetAction(command, action, [does = std::move(does)](Process& process) {
    process.EndAtOnce();
    return does();
  });
}

}  // namespace plumb
