#pragma once

#include <filesystem>
#include <string>

#include "calibrator/report/residuals.h"
#include "calibrator/results/findings.h"
#include "calibrator/results/posterior_file.h"
#include "robot/description.h"

namespace plumb {

/// The contents of report.html: one page for people, with everything in it. It needs no network and
/// no script, fits phones, is dark where its reader prefers that, and is well-formed XML. All that
/// comes from files is escaped. Of more than eight parameters the pair plot shows those that the
/// data have told most about.
/// @throws std::invalid_argument as Summarise does, or if the residuals do not fit their rows.
/// Thread-safe.
std::string ReportHtml(const Findings& findings, const RobotDescription& robot,
                       const Provenance& provenance, const Residuals& residuals);

/// The same into a file, atomically. @throws std::runtime_error too, naming the file, if it cannot
/// be written.
void WriteReport(const std::filesystem::path& file, const Findings& findings,
                 const RobotDescription& robot, const Provenance& provenance,
                 const Residuals& residuals);

}  // namespace plumb
