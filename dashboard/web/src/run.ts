// What the page knows of the run: a function of what the gateway has said since the connection, and of nothing else. A replayed
// log looks as a live run does for that reason.
import { batch, signal, type Signal } from "@preact/signals";
import type { Channels, Gateway, Posterior, Prediction, Robot, Scene } from "./contract";
import { connect, type Listener, renew } from "./connection";
import { type Event, TELLERS, type Weight } from "./events";
import type {
  calibration_status_t, controller_status_t, driver_status_t, estimator_status_t, parameter_distribution_t, place_robot_t,
  robot_state_t, training_status_t,
} from "./messages";

export const robot = signal<Robot | null>(null);
// The newest of each topic.
export const driver = signal<driver_status_t | null>(null);
export const estimator = signal<estimator_status_t | null>(null);
export const controller = signal<controller_status_t | null>(null);
export const robotState = signal<robot_state_t | null>(null);
export const placing = signal<place_robot_t | null>(null);
export const distribution = signal<parameter_distribution_t | null>(null);
export const channels = signal<Channels | null>(null);
export const gateway = signal<Gateway | null>(null);
export const scene = signal<Scene | null>(null);
// Histories.
export const posteriors = signal<Posterior[]>([]); // by iteration
export const calibrations = signal<calibration_status_t[]>([]); // by iteration
export const trainings = signal<training_status_t[]>([]); // by iteration and update
export const outcomes = signal<controller_status_t[]>([]); // the last of each policy and purpose
export const predictions = signal<Prediction[]>([]); // the last PREDICTIONS
export const events = signal<Event[]>([]); // the newest first
/** When the newest message came, of the page's clock [ms], and when the run began that is shown [us]. */
export const lastHeard = signal(0);
export const begin = signal(Infinity);
/** Of each topic: when its newest message came, of the page's clock [ms]. */
export const heard = new Map<string, number>();

const PREDICTIONS = 500;
const EVENTS = 400;
const PUBLISH_EVERY = 100; // [ms] as fast as numbers can be read

const decoder = new TextDecoder();
const decode = <T>(json: DataView) => JSON.parse(decoder.decode(json)) as T;

// Signals are set in one go, so that a burst of messages is drawn once.
let unpublished: Map<unknown, () => void> = new Map();
let timer: ReturnType<typeof setTimeout> | null = null;

function publish(key: unknown, set: () => void) {
  unpublished.set(key, set);
  timer ??= setTimeout(() => {
    timer = null;
    const due = unpublished;
    unpublished = new Map();
    batch(() => due.forEach((one) => one()));
  }, PUBLISH_EVERY);
}

/** Of a topic of which only the newest counts: it is not even decoded before it is shown. */
const newest = <T>(target: Signal<T | null>): Listener => (json) => publish(target, () => (target.value = decode<T>(json)));

/** `item` ends `items`: what has a key that is not smaller belongs to a run before this one, or is the same said again. */
function append<T>(items: T[], item: T, key: (one: T) => number) {
  while (items.length && key(items[items.length - 1]!) >= key(item)) items.pop();
  items.push(item);
}

function history<T>(target: Signal<T[]>, key: (one: T) => number): (item: T) => void {
  return (item) => {
    append(target.value, item, key);
    publish(target, () => (target.value = [...target.value]));
  };
}

const keepPosterior = history(posteriors, (one: Posterior) => one.iteration);
const keepCalibration = history(calibrations, (one: calibration_status_t) => one.iteration);
const keepTraining = history(trainings, (one: training_status_t) => one.iteration * 1e6 + one.update);
const keepOutcome = history(outcomes, (one: controller_status_t) => one.policy_iteration * 2 + one.purpose);

function keepPrediction(json: DataView) {
  const prediction = decode<Prediction>(json);
  const kept = predictions.value;
  if (kept.length && kept[kept.length - 1]!.utime >= prediction.utime) kept.length = 0;
  kept.push(prediction);
  if (kept.length > PREDICTIONS) kept.splice(0, kept.length - PREDICTIONS);
  publish(predictions, () => (predictions.value = [...kept]));
}

export function note(time: number, from: string, text: string, weight: Weight = "note") {
  const kept = events.value;
  // Histories come channel by channel; what was said at the same time has an order all the same.
  let place = 0;
  while (place < kept.length && (kept[place]!.time - time || (kept[place]!.from > from ? 1 : 0)) > 0) place++;
  kept.splice(place, 0, { time, from, text, weight });
  if (kept.length > EVENTS) kept.length = EVENTS;
  publish(events, () => (events.value = [...kept]));
}

/** Of a topic that tells a story. */
function telling<T>(channel: string, target: Signal<T | null> | null, keep?: (now: T) => void): Listener {
  const [from, tell] = TELLERS[channel]!;
  return (json, time) => {
    const now = decode<T>(json);
    for (const [text, weight] of tell(now as never, (before.get(channel) ?? null) as never)) note(time, from, text, weight);
    before.set(channel, now);
    keep?.(now);
    if (target) publish(target, () => (target.value = now));
  };
}
const before = new Map<string, unknown>();

// Not asked of what is shown, which may be late, or forgotten.
let rewinds: number | null = null;

/** Where the run has been set back, as a log that is played from an earlier place on, the gateway knows what it was then. */
function keepGateway(json: DataView) {
  const now = decode<Gateway>(json);
  const before = rewinds;
  rewinds = now.rewinds;
  if (before !== null && rewinds !== before) renew();
  publish(gateway, () => (gateway.value = now));
}

const listeners = new Map<string, Listener>([
  ["ROBOT_STATE", newest(robotState)],
  ["PLACE_ROBOT", newest(placing)],
  ["PARAMETER_DISTRIBUTION", newest(distribution)],
  ["PLUMB_CHANNELS", newest(channels)],
  ["PLUMB_GATEWAY", keepGateway],
  ["PLUMB_PREDICTION", keepPrediction],
  ["PLUMB_POSTERIOR", (json) => keepPosterior(decode<Posterior>(json))],
  ["DRIVER_STATUS", telling("DRIVER_STATUS", driver)],
  ["ESTIMATOR_STATUS", telling("ESTIMATOR_STATUS", estimator)],
  ["CONTROLLER_STATUS", telling<controller_status_t>("CONTROLLER_STATUS", controller, (now) => now.policy_iteration >= 0 && keepOutcome(now))],
  ["CALIBRATION_STATUS", telling<calibration_status_t>("CALIBRATION_STATUS", null, keepCalibration)],
  ["TRAINING_STATUS", telling<training_status_t>("TRAINING_STATUS", null, keepTraining)],
]);

// The picture moves as fast as the browser draws.
let picture: DataView | null = null;
listeners.set("PLUMB_SCENE", (json) => {
  if (!picture) requestAnimationFrame(() => {
    if (picture) scene.value = decode<Scene>(picture);
    picture = null;
  });
  picture = json;
});

function forget() {
  unpublished.clear();
  before.clear();
  heard.clear();
  picture = null;
  batch(() => {
    for (const one of [driver, estimator, controller, robotState, placing, distribution, channels, gateway, scene]) one.value = null;
    for (const one of [posteriors, calibrations, trainings, outcomes, predictions, events]) one.value = [];
    begin.value = Infinity;
  });
  fetch("/robot.json").then((answer) => answer.json()).then((found: Robot) => (robot.value = found), () => {});
}

/** Listens to the gateway that has sent the page. */
export function listen() {
  const timed = new Map<string, Listener>();
  for (const [topic, listener] of listeners) {
    timed.set(topic, (json, time) => {
      const now = performance.now();
      heard.set(topic, now);
      if (time < begin.peek() && time > 0) begin.value = time;
      if (now - lastHeard.peek() > PUBLISH_EVERY) lastHeard.value = now;
      listener(json, time);
    });
  }
  connect(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/`, timed, forget);
}
