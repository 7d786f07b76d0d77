#pragma once

#include <algorithm>
#include <catch2/catch.hpp>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "tests/cli/shell.h"

namespace plumb {

/// `plumb sim`, run as by a person without a screen.
inline Outcome Sim(const std::string& arguments) {
  return Shell("DISPLAY= " + Plumb() + "sim " + arguments);
}

/// What it has written to --csv.
struct SimTable {
  std::vector<std::string> names;
  std::vector<std::vector<double>> rows;
  double at(size_t row, const std::string& name) const {
    const auto column = std::find(names.begin(), names.end(), name);
    REQUIRE(column != names.end());
    return rows.at(row).at(static_cast<size_t>(column - names.begin()));
  }
};

inline SimTable ReadSimTable(const std::string& file) {
  SimTable table;
  std::ifstream stream(file);
  std::string line, field;
  std::getline(stream, line);
  for (std::istringstream fields(line); std::getline(fields, field, ',');)
    table.names.push_back(field);
  while (std::getline(stream, line)) {
    table.rows.emplace_back();
    for (std::istringstream fields(line); std::getline(fields, field, ',');) {
      table.rows.back().push_back(std::stod(field));
    }
    REQUIRE(table.rows.back().size() == table.names.size());
  }
  return table;
}

}  // namespace plumb
