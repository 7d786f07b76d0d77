import { effect, signal } from "@preact/signals";
import { useEffect, useRef, useState } from "preact/hooks";
import { DASH, number, plusMinus, withUnit } from "../format";
import { controller_status_t } from "../messages";
import { Choice, Key, Panel } from "../parts/panel";
import { sideView } from "../robot/side";
import type { OpenView, View } from "../robot/view";
import { controller, placing, predictions, robot, robotState, scene } from "../run";
import { colour, colours } from "../theme";
import { PHASES } from "../events";

type Eye = "in space" | "from the side";
const eye = signal<Eye>("in space");
const wished = signal(false); // in space, even if it is slow

/** The view that was asked for, or from the side where there is no WebGL, or no quick one and nobody insists. */
async function open(canvas: HTMLCanvasElement, how: Eye): Promise<View> {
  if (how === "in space") {
    try {
      const address = "/robot.js"; // loaded when it is looked at, not bundled
      const { open: openInSpace } = (await import(address)) as { open: OpenView };
      return openInSpace(canvas, colour, wished.value);
    } catch {
      eye.value = "from the side";
      return { draw() {}, close() {} }; // the canvas gives way to another
    }
  }
  return sideView(canvas);
}

function Picture({ how }: { how: Eye }) {
  const canvas = useRef<HTMLCanvasElement>(null);
  const [seen, setSeen] = useState(false);
  useEffect(() => {
    const watch = new IntersectionObserver((entries) => setSeen(entries.some((entry) => entry.isIntersecting)));
    watch.observe(canvas.current!);
    return () => watch.disconnect();
  }, []);
  useEffect(() => {
    if (!seen) return;
    let view: View | null = null;
    let stop: (() => void) | null = null;
    let gone = false;
    open(canvas.current!, how).then((opened) => {
      if (gone) return opened.close();
      view = opened;
      stop = effect(() => {
        void colours.value;
        if (scene.value) opened.draw(scene.value);
      });
    });
    return () => {
      gone = true;
      stop?.();
      view?.close();
    };
  }, [seen]);
  const label = how === "in space" ? "The robot in three dimensions. Drag to turn it." : "The robot from the side";
  return <canvas class="picture" ref={canvas} role="img" aria-label={label} data-drawn={scene.value ? "yes" : "no"} />;
}

function Coordinates() {
  const now = robotState.value;
  const last = predictions.value[predictions.value.length - 1];
  const { coordinates = [], velocities = [] } = robot.value ?? {};
  const n = now?.num_positions ?? coordinates.length;
  // A quaternion has four entries, the rate and the standard deviations about the axes three.
  const named = new Map(velocities.map(({ name }, i) => [name, i]));
  return (
    <div class="scroll" tabIndex={0} role="region" aria-label="State">
      <table class="state">
        <caption class="unseen">The state, its standard deviation and how far the one-step prediction was off</caption>
        <thead><tr><th scope="col">coordinate</th><th scope="col">position</th><th scope="col">prediction off by</th><th scope="col">velocity</th></tr></thead>
        <tbody>
          {Array.from({ length: n }, (_, i) => {
            const q = last?.q[i], measured = last?.q_measured[i];
            const off = q == null || measured == null ? null : q - measured;
            const at = coordinates[i] ? named.get(coordinates[i].name) : i;
            const v = at == null ? null : now?.v[at];
            const turns = coordinates[i]?.unit === "1";
            return (
              <tr key={i}>
                <th scope="row">{withUnit(coordinates[i]?.name ?? `q[${i}]`, coordinates[i]?.unit)}</th>
                <td class="n" data-value={now?.q[i] ?? "null"}>{!now ? DASH : turns || at == null ? number(now.q[i]) : plusMinus(now.q[i], now.q_sd[at])}</td>
                <td class="n" data-value={off ?? "null"}>{number(off, 2)}</td>
                <td class="n" data-value={v ?? "null"} title={at == null ? "" : velocities[at]?.unit ?? ""}>{now && at != null ? plusMinus(now.v[at], now.v_sd[at]) : DASH}</td>
              </tr>
            );
          })}
        </tbody>
      </table>
    </div>
  );
}

function Episode() {
  const now = controller.value;
  if (!now) return <p class="line">No controller has been heard.</p>;
  const policy = now.policy_iteration < 0 ? "no policy yet" : `policy ${now.policy_iteration}`;
  const wish = now.phase === controller_status_t.PLACING && placing.value ? `, to be placed at ${placing.value.q.map((q) => number(q, 3)).join(", ")}` : "";
  return (
    <p class="line" data-episode>
      <b>{PHASES[now.phase] ?? now.phase}</b>{now.reason ? `: ${now.reason}` : ""}, {policy}{wish}; episode {now.num_episodes + (now.phase === controller_status_t.RUNNING ? 1 : 0)} of {now.episodes_wanted},
      step <span data-value={now.step}>{now.step}</span>, return so far <span data-value={now.episode_return ?? "null"}>{number(now.episode_return)}</span>
    </p>
  );
}

export function RobotPanel() {
  const now = robotState.value;
  const how = eye.value;
  const contacts = now?.contact.map((one) => (one === 1 ? "●" : one === 0 ? "○" : "?")).join(" ");
  return (
    <Panel id="robot" title="The robot" size="wide" aside={<Choice name="View" options={["in space", "from the side"] as const} value={how} choose={(to) => { wished.value = true; eye.value = to; }} />}
      what="Solid: the robot as the observer sees it. Translucent: where the simulator at the posterior's mean says that it should be, from the state and the command before.">
      <div class="stage">
        <Picture key={how} how={how} />
        {!scene.value && <p class="empty over">No state of the robot has come yet.</p>}
      </div>
      <Key items={[["robot", "robot"], ["simulation ghost", "prediction"]]} />
      <Episode />
      <Coordinates />
      {now && !now.valid && <p class="line bad">The state is not valid: nothing acts on it.</p>}
      {contacts && <p class="line">Ground contacts: <span aria-label={now!.contact.map((one) => (one === 1 ? "touching" : one === 0 ? "free" : "unknown")).join(", ")}>{contacts}</span></p>}
    </Panel>
  );
}
