// What the gateway says besides the robot's own messages: docs/dashboard.md. What is not given is null.

export type Value = number | null;

export interface Named {
  name: string;
  unit: string | null;
}

export interface Joint {
  name: string;
  type: string;
  unit_position: string | null;
  unit_velocity: string | null;
  unit_effort: string | null;
  lower: Value;
  upper: Value;
  effort: Value;
  velocity: Value;
}

/** /robot.json */
export interface Robot {
  name: string;
  version: string;
  joints: Joint[];
  coordinates: Named[]; // of q
  velocities: Named[]; // of v
  parameters: (Named & { prior_mean: Value; prior_sd: Value })[];
  task: { name: string; period: number; steps: number } | null; // steps of a whole episode
  channels: string[];
  may_control: boolean;
  why_not: string;
}

export interface ChannelCount {
  channel: string;
  type: string;
  count: number;
  rate: Value;
  jitter_ms: Value;
  bytes_per_second: Value;
  undecodable: number;
  refused: number;
  intervals: number[]; // between two arrivals, counted in bins as DRIVER_STATUS has them
  age_ms: Value;
}

/** PLUMB_CHANNELS */
export interface Channels {
  utime: number;
  channels: ChannelCount[];
}

/** PLUMB_PREDICTION: what the simulator made of the state before and the command that answered it. */
export interface Prediction {
  utime: number;
  sequence: number;
  q: Value[];
  v: Value[];
  q_measured: Value[];
}

export interface PosteriorParameter extends Named {
  mean: Value;
  sd: Value;
  quantiles: Value[]; // 2.5, 25, 50, 75, 97.5 %
  prior_mean: Value;
  prior_sd: Value;
  determined: boolean;
}

/** PLUMB_POSTERIOR */
export interface Posterior {
  utime: number;
  iteration: number;
  parameters: PosteriorParameter[];
  samples: Value[][];
  prior_samples: Value[][];
}

/** PLUMB_GATEWAY */
export interface Gateway {
  utime: number;
  clock: "real" | "virtual" | "replay";
  speed: Value; // seconds of the run in a second
  clients: number;
  dropped: number;
  rewinds: number; // how often the run has been set back
}

export interface Vector {
  x: number;
  y: number;
  z: number;
}

export interface Pose {
  position: Vector;
  orientation: Vector & { w: number };
}

export interface Colour {
  r: number;
  g: number;
  b: number;
  a: number;
}

export interface Cube {
  pose: Pose;
  size: Vector;
  color: Colour;
}

export interface Cylinder extends Cube {
  bottom_scale: number;
  top_scale: number;
}

/** Of foxglove.SceneUpdate what is drawn here. */
export interface Entity {
  id: string;
  cubes?: Cube[];
  spheres?: Cube[];
  cylinders?: Cylinder[];
}

/** PLUMB_SCENE */
export interface Scene {
  deletions?: { type: number; id: string }[];
  entities: Entity[];
}

/** Of every service. */
export interface Answer {
  ok: boolean;
  text: string;
}
export type Service = "emergency_stop" | "arm" | "disarm" | "confirm_placed";
