// What has happened, told from how one message differs from the one before it.
import { calibration_status_t, controller_status_t, driver_status_t, estimator_status_t, policy_t, training_status_t } from "./messages";

export type Weight = "note" | "good" | "bad";

export interface Event {
  time: number; // [us]
  from: string;
  text: string;
  weight: Weight;
}

type Said = [text: string, weight?: Weight];

/** What a message's constants are called, by their values. @param prefix of those that are meant; it is left out. */
function namesOf(constants: Record<string, number>, prefix = ""): string[] {
  const names: string[] = [];
  for (const [name, value] of Object.entries(constants)) if (name.startsWith(prefix)) names[value] ??= name.slice(prefix.length).toLowerCase();
  return names;
}
export const DRIVER_STATES = namesOf(driver_status_t), SENSOR_STATES = namesOf(driver_status_t, "SENSOR_");
export const PHASES = namesOf(controller_status_t);

const because = (reason: string) => (reason ? `: ${reason}` : "");

function driver(now: driver_status_t, before: driver_status_t | null): Said[] {
  const said: Said[] = [];
  if (!before || now.state !== before.state || now.reason !== before.reason) {
    const weight = now.state === driver_status_t.FAULT ? "bad" : now.state === driver_status_t.ARMED ? "good" : "note";
    said.push([`${DRIVER_STATES[now.state] ?? now.state}${because(now.reason)}`, weight]);
  }
  now.buses.forEach(({ name, up }, i) => {
    const was = before?.buses[i]?.up ?? true;
    if (up !== was) said.push([`${name ? `bus ${name}` : "the bus"} is ${up ? "up" : "down"}`, up ? "good" : "bad"]);
  });
  now.sensor_name.forEach((name, i) => {
    if (before && now.sensor_state[i] !== before.sensor_state[i] && now.sensor_reason[i]) said.push([`${name}: ${now.sensor_reason[i]}`, "bad"]);
  });
  return said;
}

function estimator(now: estimator_status_t, before: estimator_status_t | null): Said[] {
  const said: Said[] = [];
  // That a filter begins anew where the robot was placed is no event.
  const lacking = (one: estimator_status_t | null) => (one && !one.valid && !/just started/.test(one.reason) ? one.reason : "");
  if (lacking(now) && lacking(now) !== lacking(before)) said.push([`the state is not valid: ${lacking(now)}`, "bad"]);
  if (now.valid && (!before || lacking(before))) said.push(["the state is valid", "good"]);
  now.joint_name.forEach((name, i) => {
    const reason = now.joint_reason[i];
    if (reason && reason !== before?.joint_reason[i]) said.push([`${name}: ${reason}`, "bad"]);
  });
  return said;
}

function controller(now: controller_status_t, before: controller_status_t | null): Said[] {
  const said: Said[] = [];
  if (!before || now.policy_iteration !== before.policy_iteration || now.purpose !== before.purpose) {
    if (now.policy_iteration >= 0) said.push([`policy ${now.policy_iteration}, ${now.purpose === policy_t.EVALUATE ? "to be judged" : "to learn from"}`]);
  }
  const settled = now.phase === controller_status_t.HALTED || now.phase === controller_status_t.WAITING;
  if (settled && (now.phase !== before?.phase || now.reason !== before.reason) && now.reason) {
    said.push([`${PHASES[now.phase]}${because(now.reason)}`, now.phase === controller_status_t.HALTED ? "bad" : "note"]);
  }
  if (before && now.episodes_aborted > before.episodes_aborted) said.push(["an episode was given up", "bad"]);
  if (now.phase === controller_status_t.COMPLETE && before?.phase !== now.phase) {
    said.push([`policy ${now.policy_iteration}: ${now.num_episodes} of ${now.episodes_wanted} episodes done`, "good"]);
  }
  return said;
}

function calibration(now: calibration_status_t, before: calibration_status_t | null): Said[] {
  const said: Said[] = [];
  if (now.iteration > 0 && now.iteration !== before?.iteration) said.push([`iteration ${now.iteration}: ${now.transitions} transitions`, "good"]);
  if (now.alarm !== (before?.alarm ?? "")) said.push(now.alarm ? [now.alarm, "bad"] : ["the alarm has ended", "good"]);
  if (now.gap && now.gap !== before?.gap) said.push([now.gap]);
  return said;
}

function training(now: training_status_t, before: training_status_t | null): Said[] {
  const said: Said[] = [];
  if (now.decision && now.decision !== before?.decision) said.push([now.decision, "good"]);
  if (now.complete && (!before?.complete || now.iteration !== before.iteration)) said.push([`policy ${now.iteration} is trained`]);
  return said;
}

/** Who says what on which channel. */
export const TELLERS: Record<string, [from: string, tell: (now: never, before: never) => Said[]]> = {
  DRIVER_STATUS: ["driver", driver],
  ESTIMATOR_STATUS: ["estimator", estimator],
  CONTROLLER_STATUS: ["controller", controller],
  CALIBRATION_STATUS: ["calibrator", calibration],
  TRAINING_STATUS: ["trainer", training],
};
