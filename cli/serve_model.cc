#include "cli/serve_model.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <iostream>

#include "cli/logs.h"
#include "common/listen_address.h"
#include "common/thread_count.h"
#include "umbridge/robot_models.h"
#include "umbridge/server.h"

namespace plumb {

int ServeModel(Process& process, const ServeModelFlags& flags) {
  const ListenAddress listen = ListenAddress::Parse(flags.address);
  const RobotDescription robot = LoadRobot(flags.robot);
  for (const std::string& warning : robot.warnings) spdlog::warn(warning);
  const std::vector<Log> logs = ReadLogs(flags.logs, flags.tables, robot);
  PrintLogs(logs);
  RobotModels models(robot, logs, ExecutionOptions(ThreadCount(flags.threads)));
  std::vector<std::string> names;
  for (const std::string& name : flags.hosts) names.push_back(HostAndPort::Split(name).host);
  UmbridgeServer server(listen, names, models.Models());
  std::cout << "parameters, in this order and unit:";
  for (const ParameterDescription& p : robot.parameters)
    std::cout << fmt::format(" {} [{}]", p.name, p.unit);
  std::cout << "\n";
  for (const ServedModel& model : models.Models())
    std::cout << fmt::format("{}: {} -> {}\n", model.name, model.inputs, model.outputs);
  std::cout << server.url() << std::endl;
  server.Run(process.stop_fd(), [&] { return process.stopping(); });
  return 0;
}

}  // namespace plumb
