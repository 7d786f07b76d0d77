// Randomised hoppers in MuJoCo: each row of a table that `plumb export-model --randomisation` has
// written is a hopper. Without any action, how long do they stand?
//
//   topple hopper.xml table.json

#include <mujoco/mujoco.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <exception>
#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>
#include <vector>

#include "parameters.h"

namespace {

using Numbers = std::vector<double>;

constexpr double kStanding = 1.25, kFallen = 0.7;  // [m] height of the torso
constexpr double kLongest = 5;                     // [s]

std::unique_ptr<mjModel, decltype(&mj_deleteModel)> Load(const char* file) {
  char error[1000] = "";
  std::unique_ptr<mjModel, decltype(&mj_deleteModel)> model(
      mj_loadXML(file, nullptr, error, sizeof error), &mj_deleteModel);
  if (!model) throw std::runtime_error(error);
  return model;
}

/// [s] until the hopper has fallen.
double Stand(const mjModel* model, mjData* data) {
  const int height = model->jnt_qposadr[mj_name2id(model, mjOBJ_JOINT, "rootz")];
  mj_resetData(model, data);
  data->qpos[height] = kStanding;
  while (data->qpos[height] > kFallen && data->time < kLongest) mj_step(model, data);
  return data->time;
}

}  // namespace

int main(int argc, char** argv) try {
  if (argc != 3) throw std::runtime_error("usage: topple hopper.xml table.json");
  const nlohmann::json table = nlohmann::json::parse(std::ifstream(argv[2]));
  const auto names = table.at("names").get<std::vector<std::string>>();
  const auto mean = table.at("mean").get<Numbers>();
  const auto nominal = Load(argv[1]);
  const std::unique_ptr<mjData, decltype(&mj_deleteData)> data(mj_makeData(nominal.get()),
                                                               &mj_deleteData);
  std::printf("the mean stands for %.3f s\n", Stand(nominal.get(), data.get()));

  Numbers times;
  for (const auto& sample : table.at("samples").get<std::vector<Numbers>>()) {
    const std::unique_ptr<mjModel, decltype(&mj_deleteModel)> model(
        mj_copyModel(nullptr, nominal.get()), &mj_deleteModel);
    for (size_t i = 0; i < names.size(); ++i)
      SetParameter(model.get(), names[i], sample.at(i), mean.at(i));
    mj_setConst(model.get(), data.get());
    times.push_back(Stand(model.get(), data.get()));
  }
  const auto [shortest, longest] = std::minmax_element(times.begin(), times.end());
  std::printf("%zu of the table stand for %.3f to %.3f s\n", times.size(), *shortest, *longest);
} catch (const std::exception& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
