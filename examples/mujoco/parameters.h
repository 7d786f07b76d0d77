#pragma once

#include <mujoco/mujoco.h>

#include <stdexcept>
#include <string>

/// Gives a MuJoCo model, read from what `plumb export-model --mjcf` has written, another value of a
/// parameter. Call mj_setConst when all are given: MuJoCo derives from them what it needs for
/// constraints. Not thread-safe for one model.
/// @param name "mass/thigh", as in the table of --randomisation. @param mean what the model has.
/// @throws std::invalid_argument for a parameter that is not a single number there: com and length
/// move bodies, inertia/<link>/xx and its like turn them.
inline void SetParameter(mjModel* model, const std::string& name, double value, double mean) {
  const std::string kind = name.substr(0, name.find('/'));
  const std::string of = name.size() > kind.size() ? name.substr(kind.size() + 1) : "";
  const auto find = [&](mjtObj type) {
    const int id = mj_name2id(model, type, of.c_str());
    if (id < 0) throw std::invalid_argument(name + ": the model has nothing of that name");
    return id;
  };
  const auto dof = [&] { return model->jnt_dofadr[find(mjOBJ_JOINT)]; };
  if (name == "gravity") {
    for (int k = 0; k < 3; ++k) model->opt.gravity[k] *= value / mean;
  } else if (kind == "mass") {  // the shape stays: inertia goes with it
    const int body = find(mjOBJ_BODY);
    model->body_mass[body] *= value / mean;
    for (int k = 0; k < 3; ++k) model->body_inertia[3 * body + k] *= value / mean;
  } else if (kind == "inertia" && of.find('/') == std::string::npos) {
    const int body = find(mjOBJ_BODY);
    for (int k = 0; k < 3; ++k) model->body_inertia[3 * body + k] *= value / mean;
  } else if (kind == "damping") {
    model->dof_damping[dof()] = value;
  } else if (kind == "friction") {
    model->dof_frictionloss[dof()] = value;
  } else if (kind == "armature") {
    model->dof_armature[dof()] = value;
  } else if (kind == "stiffness") {
    model->jnt_stiffness[find(mjOBJ_JOINT)] = value;
  } else if (kind == "rest") {
    model->qpos_spring[model->jnt_qposadr[find(mjOBJ_JOINT)]] = value;
  } else if (kind == "gain") {
    model->actuator_gear[6 * find(mjOBJ_ACTUATOR)] = value;
  } else if (name == "contact/friction") {
    for (int geom = 0; geom < model->ngeom; ++geom) model->geom_friction[3 * geom] = value;
  } else {
    throw std::invalid_argument(name + ": not a single number of MuJoCo's model");
  }
}
