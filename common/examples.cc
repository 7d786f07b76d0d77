#include "common/examples.h"

#include <CLI/CLI.hpp>

namespace plumb {

void AddExamples(CLI::App& app, const std::vector<std::string>& commands) {
  std::string text = app.get_footer();
  if (!text.empty()) text += "\n\n";
  text += "Examples:";
  for (const std::string& command : commands) text += "\n  " + command;
  app.footer(text);
}

}  // namespace plumb
