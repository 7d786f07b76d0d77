import { grouped, number } from "../format";
import type { training_status_t } from "../messages";
import { Chart } from "../parts/chart";
import { Panel } from "../parts/panel";
import { trainings } from "../run";

const CURVES: [label: string, pick: (one: training_status_t) => number | null][] = [
  ["mean return", (one) => one.mean_return],
  ["KL divergence [nat]", (one) => one.kl],
  ["surrogate gain", (one) => one.surrogate_gain],
  ["explained variance", (one) => one.explained_variance],
  ["entropy", (one) => one.entropy],
];
const MOST = 600; // points that a curve of this width can show

/** Updates of all iterations, one behind the other. */
function numbered(all: training_status_t[]): number[] {
  let before = 0, iteration = all[0]?.iteration ?? 0, last = 0;
  return all.map((one) => {
    if (one.iteration !== iteration) {
      before += last;
      iteration = one.iteration;
    }
    last = one.update;
    return before + one.update;
  });
}

export function TrainingPanel() {
  const all = trainings.value;
  const newest = all[all.length - 1];
  const every = Math.ceil(all.length / MOST);
  const kept = (_: unknown, i: number) => i % every === 0 || i === all.length - 1;
  const x = numbered(all).filter(kept);
  const shown = all.filter(kept);
  return (
    <Panel id="training" title="Training" size="wide" empty={!newest && "The trainer has said nothing yet."}
      what="TRPO's updates of the policy, of all iterations one after the other: what a batch earned, how far the policy moved, what was to be gained, how well the critic foresaw it, and how much it still tries out."
      numbers={() => [{
        caption: "Updates", columns: ["iteration", "update", "steps", ...CURVES.map(([label]) => label)],
        rows: all.slice(-200).map((one) => [one.iteration, one.update, one.steps, ...CURVES.map(([, pick]) => pick(one))]),
      }]}>
      {newest && (
        <p class="line">
          Policy <b data-value={newest.iteration}>{newest.iteration}</b>: update <span data-value={newest.update}>{newest.update}</span> of {newest.updates}
          {newest.complete ? ", complete" : ""}; <span data-value={newest.steps}>{grouped(newest.steps)}</span> simulated steps in all.
          {newest.dropped_episodes > 0 && <> <span data-value={newest.dropped_episodes}>{grouped(newest.dropped_episodes)}</span> episodes were dropped, as their simulation did not stay finite.</>}
          {newest.incumbent >= 0 && ` Policy ${newest.incumbent} runs the robot since iteration ${newest.incumbent_since}.`}
        </p>
      )}
      <div class="parameters">
        {CURVES.map(([label, pick]) => (
          <figure key={label}>
            <figcaption><b>{label}</b><span data-value={newest ? (pick(newest) ?? "null") : "null"}>{number(newest && pick(newest))}</span></figcaption>
            <Chart height={120} whole label={`${label} over the updates`} x={x} series={[{ label, values: shown.map(pick), colour: "simulation", width: 1.4 }]} />
          </figure>
        ))}
      </div>
    </Panel>
  );
}
