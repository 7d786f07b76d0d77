import type { Prediction } from "../contract";
import { withUnit } from "../format";
import { Chart } from "../parts/chart";
import { Key, Panel } from "../parts/panel";
import { predictions, robot } from "../run";

const WINDOW = 10; // [s] of the robot

const HEIGHTS = [330, 165, 110]; // of one coordinate, of two, of three

/** Of each coordinate, in the last seconds: measured, and predicted one step before. */
export function MotionPanel() {
  const all = predictions.value;
  const newest = all[all.length - 1];
  const shown = newest ? all.filter((one) => newest.utime - one.utime <= WINDOW * 1e6) : [];
  const x = shown.map((one) => (one.utime - newest!.utime) / 1e6);
  const coordinates = robot.value?.coordinates ?? [];
  const name = (i: number) => withUnit(coordinates[i]?.name ?? `q[${i}]`, coordinates[i]?.unit);
  const pick = (of: (one: Prediction) => Prediction["q"], i: number) => shown.map((one) => of(one)[i] ?? null);
  return (
    <Panel id="motion" title="Motion" size="third" empty={!newest && "No state that answers a command has come yet."}
      what={`Each coordinate in the last ${WINDOW} seconds as measured, with what the simulator had predicted a step before.`}
      numbers={() => [{ caption: "The newest", columns: ["coordinate", "measured", "predicted"], rows: newest!.q.map((q, i) => [name(i), newest!.q_measured[i], q]) }]}>
      <Key items={[["robot", "measured"], ["simulation dash", "predicted"]]} />
      {newest?.q.map((_, i) => (
        <figure key={i}>
          <figcaption>{name(i)}</figcaption>
          <Chart height={HEIGHTS[newest.q.length - 1] ?? 84} label={`${name(i)}: measured and predicted`} x={x}
            series={[
              { label: "measured", values: pick((one) => one.q_measured, i), colour: "robot", width: 2 },
              { label: "predicted", values: pick((one) => one.q, i), colour: "simulation", width: 1.4, dash: [4, 3] },
            ]} />
        </figure>
      ))}
      {newest && <p class="axis">seconds of the robot, up to now</p>}
    </Panel>
  );
}
