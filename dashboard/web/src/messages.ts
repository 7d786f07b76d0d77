// Made by tools/messages.mjs from lcmtypes/: units and meanings are in docs/messages.md.

export interface bus_status_t {
  name: string;
  url: string;
  up: boolean;
  frames_received: number;
  frames_sent: number;
  frames_rejected: number;
  frames_dropped: number;
  frames_foreign: number;
}

export interface calibration_status_t {
  utime: number;
  iteration: number;
  transitions: number;
  rollouts: number;
  dropped_gap: number;
  dropped_late: number;
  dropped_not_finite: number;
  dropped_restart: number;
  dropped_model_based: number;
  discrepancy: number | null;
  prior_discrepancy: number | null;
  num_horizons: number;
  horizon: number[];
  error_before: (number | null)[];
  error_after: (number | null)[];
  error_prior: (number | null)[];
  kl: number | null;
  ess: number | null;
  temperature: number | null;
  num_parameters: number;
  mean: (number | null)[];
  sd: (number | null)[];
  num_combinations: number;
  combination: string[];
  num_powers: number;
  combination_power: (number | null)[];
  combination_mean: (number | null)[];
  combination_sd: (number | null)[];
  identifiability: string;
  seconds: number | null;
  streamed_transitions: number;
  num_streamed: number;
  streamed_mean: (number | null)[];
  streamed_sd: (number | null)[];
  alarm: string;
  gap: string;
}

export interface controller_status_t {
  utime: number;
  policy_iteration: number;
  phase: number;
  reason: string;
  step: number;
  episode_return: number | null;
  num_episodes: number;
  episode: number[];
  first_state_sequence: number[];
  last_state_sequence: number[];
  returns: (number | null)[];
  steps: number[];
  late_rate: (number | null)[];
  fell: boolean[];
  episodes_wanted: number;
  purpose: number;
  episodes_aborted: number;
}
export const controller_status_t = { WAITING: 0, PLACING: 1, RUNNING: 2, COMPLETE: 3, HALTED: 4 } as const;

export interface driver_request_t {
  utime: number;
  request: number;
  identity: number;
}
export const driver_request_t = { ARM: 1, DISARM: 2, ESTOP: 3, ARM_HOMED: 4 } as const;

export interface driver_status_t {
  utime: number;
  state: number;
  reason: string;
  stopped_by_request: boolean;
  answered: number;
  robot: string;
  bus: string;
  num_buses: number;
  buses: bus_status_t[];
  num_joints: number;
  joint_name: string[];
  joint_state: number[];
  joint_reason: string[];
  motor_temperature: (number | null)[];
  drive_temperature: (number | null)[];
  bus_voltage: (number | null)[];
  bus_current: (number | null)[];
  drive_identity: string[];
  num_sensors: number;
  sensor_name: string[];
  sensor_state: number[];
  sensor_reason: string[];
  measurements_lost: number;
  commands_accepted: number;
  commands_rejected: number;
  commands_expired: number;
  commands_limited: number;
  setpoints_saturated: number;
  commands_signed: boolean;
  commands_forged: number;
  messages_rejected: number;
  cycles: number;
  overruns: number;
  num_bins: number;
  lateness: number[];
  num_phases: number;
  phase_name: string[];
  phase_duration: number[];
}
export const driver_status_t = { ABSENT: 0, IDLE: 1, ARMING: 2, ARMED: 3, FAULT: 4, SENSOR_ABSENT: 0, SENSOR_STARTING: 1, SENSOR_RUNNING: 2, SENSOR_FAULT: 3 } as const;

export interface estimator_status_t {
  utime: number;
  valid: boolean;
  reason: string;
  num_joints: number;
  joint_name: string[];
  age: (number | null)[];
  position_nis: (number | null)[];
  velocity_nis: (number | null)[];
  acceleration_nis: (number | null)[];
  bias: (number | null)[];
  joint_reason: string[];
  measurements: number;
  refused: number;
  duplicates: number;
  reordered: number;
  restarts: number;
  outages: number;
  imu_readings: number;
  imu_refused: number;
  imu_duplicates: number;
  imu_reordered: number;
  model_restarts: number;
}

export interface imu_t {
  utime: number;
  name: string;
  link: string;
  rate: (number | null)[];
  force: (number | null)[];
  orientation: (number | null)[];
  orientation_valid: boolean;
  rate_clipped: boolean;
  force_clipped: boolean;
}

export interface joint_command_t {
  utime: number;
  sequence: number;
  state_sequence: number;
  episode: number;
  step: number;
  policy_iteration: number;
  num_joints: number;
  effort: (number | null)[];
  position: (number | null)[];
  velocity: (number | null)[];
  kp: (number | null)[];
  kd: (number | null)[];
  expiry: number;
}

export interface joint_state_t {
  utime: number;
  sequence: number;
  num_joints: number;
  measured: number[];
  position: (number | null)[];
  velocity: (number | null)[];
  effort_measured: (number | null)[];
  effort_sent: (number | null)[];
  effort_applied: (number | null)[];
  valid: boolean[];
}

export interface parameter_distribution_t {
  utime: number;
  iteration: number;
  seed: number;
  num_parameters: number;
  name: string[];
  coordinate: number[];
  num_components: number;
  weight: (number | null)[];
  num_means: number;
  mean: (number | null)[];
  num_covariances: number;
  covariance: (number | null)[];
  explained: boolean;
  num_residuals: number;
  residual: residual_function_t[];
  residual_margin: number | null;
  num_draws: number;
  draw: (number | null)[];
  num_starts: number;
  start: (number | null)[];
  kl: number | null;
  ess: number | null;
  temperature: number | null;
  discrepancy: number | null;
}
export const parameter_distribution_t = { LINEAR: 0, LOG: 1, LOGIT: 2 } as const;

export interface place_robot_t {
  utime: number;
  num_positions: number;
  q: (number | null)[];
  num_velocities: number;
  v: (number | null)[];
}

export interface policy_t {
  utime: number;
  iteration: number;
  trained_in: number;
  purpose: number;
  episodes: number;
  trial_steps: number;
  num_layers: number;
  size: number[];
  num_weights: number;
  weight: (number | null)[];
  num_observations: number;
  observation_mean: (number | null)[];
  observation_scale: (number | null)[];
  num_actions: number;
  action_scale: (number | null)[];
}
export const policy_t = { CALIBRATE: 0, EVALUATE: 1 } as const;

export interface residual_function_t {
  condition: number;
  num_inputs: number;
  num_outputs: number;
  num_centres: number;
  mean: (number | null)[];
  scale: (number | null)[];
  low: (number | null)[];
  high: (number | null)[];
  num_coordinates: number;
  centre: (number | null)[];
  num_weights: number;
  weight: (number | null)[];
  num_noise: number;
  noise: (number | null)[];
  bound: (number | null)[];
  unknown: (number | null)[];
}
export const residual_function_t = { FREE: 0, TOUCHING: 1, GROUND: 2, STOP: 3 } as const;

export interface robot_state_t {
  utime: number;
  sequence: number;
  num_positions: number;
  q: (number | null)[];
  num_velocities: number;
  v: (number | null)[];
  q_sd: (number | null)[];
  v_sd: (number | null)[];
  effort: (number | null)[];
  num_contacts: number;
  contact: number[];
  model_based: boolean;
  valid: boolean;
  restarted: boolean;
}

export interface training_status_t {
  utime: number;
  iteration: number;
  update: number;
  updates: number;
  steps: number;
  dropped_episodes: number;
  mean_return: number | null;
  evaluation_return: number | null;
  evaluation_tenth: number | null;
  evaluation_worst: number | null;
  kl: number | null;
  surrogate_gain: number | null;
  explained_variance: number | null;
  entropy: number | null;
  seconds: number | null;
  complete: boolean;
  incumbent: number;
  incumbent_since: number;
  decision: string;
  challenger: number;
  probability: number | null;
  challenger_return: number | null;
  incumbent_return: number | null;
}
