// What a person may do: stop at any time, and with care the rest.
import { signal } from "@preact/signals";
import { useEffect, useRef, useState } from "preact/hooks";
import { ask, state } from "./connection";
import type { Service } from "./contract";
import { number, withUnit } from "./format";
import { controller_status_t, driver_status_t } from "./messages";
import { controller, driver, gateway, note, placing, robot } from "./run";

const NAMES: Record<Service, string> = { emergency_stop: "Emergency stop", arm: "Arm", disarm: "Disarm", confirm_placed: "Robot placed" };

export interface Outcome {
  what: string;
  text: string;
  state: "asked" | "done" | "failed";
}
/** Of what was asked last. */
export const outcome = signal<Outcome | null>(null);
/** Which confirmation is open. */
export const confirming = signal<"arm" | null>(null);

const virtual = () => gateway.value?.clock === "virtual";
/** Disarming is everybody's, as stopping is, but that a run in virtual time hears nobody. */
const mayDisarm = () => state.value === "open" && !virtual();
const mayArm = () => mayDisarm() && !!robot.value?.may_control;

let asked = 0;

export async function request(service: Service) {
  const what = NAMES[service], mine = ++asked;
  outcome.value = { what, text: "asked; waiting for the driver's answer", state: "asked" };
  const { ok, text: said } = await ask(service);
  const text = said || (ok ? "done" : "refused");
  // A late answer to an earlier wish does not hide that to a stop; it is among the events.
  if (mine === asked) outcome.value = { what, text, state: ok ? "done" : "failed" };
  // In the run's own time, as all other events.
  const now = gateway.value && gateway.value.clock !== "real" ? gateway.value.utime : Date.now() * 1000;
  note(now, "this page", `${what}: ${text}`, ok ? "note" : "bad");
}

export function stop() {
  confirming.value = null;
  void request("emergency_stop");
}

export function StopButton() {
  const dead = state.value !== "open";
  return (
    <button class="stop" onClick={stop} aria-keyshortcuts="Escape" title="Esc">
      Emergency stop{dead && <small>not connected: use the robot's own</small>}
    </button>
  );
}

export function Outcome() {
  const now = outcome.value;
  return (
    <div class="outcome" role="status" aria-live="assertive">
      {now && (
        <p class={now.state}>
          <span>
            <b>{now.what}</b>: {now.text}
          </span>
          {now.state !== "asked" && <button class="quiet" aria-label="Close this message" onClick={() => (outcome.value = null)}>×</button>}
        </p>
      )}
    </div>
  );
}

function ArmDialog() {
  const dialog = useRef<HTMLDialogElement>(null);
  const [sure, setSure] = useState(false);
  useEffect(() => dialog.current!.showModal(), []);
  const close = () => (confirming.value = null);
  return (
    <dialog ref={dialog} onClose={close} aria-labelledby="arm-title">
      <h2 id="arm-title">Switch the motors of {robot.value?.name ?? "the robot"} on?</h2>
      <p>It will move as soon as a controller commands it. Faults are cleared.</p>
      <label><input type="checkbox" checked={sure} onChange={(change) => setSure(change.currentTarget.checked)} /> Nobody is within the robot's reach, and somebody's hand is at its own emergency stop.</label>
      <p class="buttons">
        <button onClick={close}>Cancel</button>
        <button class="careful" disabled={!sure} onClick={() => { close(); void request("arm"); }}>Arm</button>
      </p>
      <p class="aside">Esc stops the robot, here as everywhere.</p>
    </dialog>
  );
}

/** The controller waits for a person to put the robot where an episode begins. */
function Placing() {
  const wish = placing.value;
  if (controller.value?.phase !== controller_status_t.PLACING || !wish) return null;
  const { coordinates = [], velocities = [] } = robot.value ?? {};
  const at = wish.q.map((q, i) => `${withUnit(coordinates[i]?.name ?? `q[${i}]`, coordinates[i]?.unit)} ${number(q, 3)}`);
  const moving = wish.v.flatMap((v, i) => (v ? [`${withUnit(velocities[i]?.name ?? `v[${i}]`, velocities[i]?.unit)} ${number(v, 3)}`] : []));
  return (
    <div class="placing">
      <p><b>Place the robot</b> at {at.join(", ")}{moving.length ? `, moving with ${moving.join(", ")}` : ""}.</p>
      <button disabled={!mayArm()} onClick={() => void request("confirm_placed")}>It is placed</button>
    </div>
  );
}

export function Controls() {
  const armed = driver.value?.state === driver_status_t.ARMED || driver.value?.state === driver_status_t.ARMING;
  const why = virtual() ? "a run in virtual time hears nobody from outside" : robot.value && !robot.value.may_control ? robot.value.why_not : "";
  return (
    <>
      <div class="controls" role="group" aria-label="Motors">
        <button disabled={!mayArm() || armed} onClick={() => (confirming.value = "arm")}>Arm…</button>
        <button disabled={!mayDisarm() || !armed} onClick={() => void request("disarm")}>Disarm</button>
        {why && <p class="aside">{why}</p>}
      </div>
      <Placing />
      {confirming.value === "arm" && <ArmDialog />}
    </>
  );
}
