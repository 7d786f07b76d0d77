import type { Value } from "../contract";
import { number } from "../format";
import { Chart } from "../parts/chart";
import { Panel } from "../parts/panel";
import { calibrations } from "../run";

const CURVES: [label: string, pick: "kl" | "ess" | "temperature", what: string][] = [
  ["KL divergence [nat]", "kl", "how much was learnt"],
  ["effective samples", "ess", "that the update rests on; only where samples are weighted"],
  ["temperature", "temperature", "1: as sure as Bayes' rule"],
];

const positive = (values: Value[]) => values.some((value) => value !== null) && values.every((value) => value === null || value > 0);

export function UpdatePanel() {
  const all = calibrations.value.filter((one) => one.iteration > 0);
  const newest = all[all.length - 1];
  return (
    <Panel id="update" title="Each update of the posterior" empty={!newest && "There has been no update yet."}
      what="How far each calibration moved the posterior (KL divergence), on how many effective samples (ESS) it rests, and how cautious it was (temperature)."
      numbers={() => [{
        caption: "Updates", columns: ["iteration", "KL", "ESS", "temperature", "transitions", "roll-outs", "s"],
        rows: all.map((one) => [one.iteration, one.kl, one.ess, one.temperature, one.transitions, one.rollouts, one.seconds]),
      }]}>
      {CURVES.map(([label, pick, what]) => {
        const values = all.map((one) => one[pick]);
        const now = newest?.[pick] ?? null;
        return (
          <figure key={pick}>
            <figcaption><b>{label}</b><span data-value={now ?? "null"}>{number(now)}</span></figcaption>
            {values.some((value) => value !== null)
              ? <Chart height={88} whole label={`${label} over the iterations`} x={all.map((one) => one.iteration)} logarithmic={pick === "kl" && positive(values)} series={[{ label, values, colour: "posterior", points: true }]} />
              : <p class="aside">{what}: not given by this method</p>}
          </figure>
        );
      })}
      {newest && <p class="line">{newest.transitions} transitions of {newest.rollouts} roll-outs.</p>}
    </Panel>
  );
}
