import { Chart, type Series } from "../parts/chart";
import { Key, Panel } from "../parts/panel";
import { calibrations } from "../run";

const FADED = 4; // iterations before the newest that are drawn

export function FanPanel() {
  const all = calibrations.value.filter((one) => one.num_horizons > 0);
  const newest = all[all.length - 1];
  const series: Series[] = newest ? [
    { label: "prior", values: newest.error_prior, colour: "prior", dash: [5, 3], points: true },
    ...all.slice(-1 - FADED, -1).map((one, i, these): Series => ({
      label: `iteration ${one.iteration}`, values: one.error_after, colour: "posterior", opacity: 0.15 + (0.25 * (i + 1)) / these.length, width: 1.2,
    })),
    { label: "before", values: newest.error_before, colour: "simulation", points: true },
    { label: "after", values: newest.error_after, colour: "posterior", width: 2.2, points: true, to: "prior" },
  ] : [];
  return (
    <Panel id="fan" title="Error after n steps" empty={!newest && "No roll-out has been compared with its prediction yet."}
      what="How far predictions of the newest roll-out are off after n control steps, in standard units: by the prior, by the posterior that had not seen the roll-out, and by the one that has."
      numbers={() => [{
        caption: "Root mean square error after n steps", columns: ["iteration", "n", "prior", "before", "after"],
        rows: all.flatMap((one) => one.horizon.map((n, i) => [one.iteration, n, one.error_prior[i], one.error_before[i], one.error_after[i]])),
      }]}>
      <Key items={[["prior dash", "prior"], ["simulation", "before it was seen"], ["posterior", "after"], ["posterior faint", "iterations before"]]} />
      {newest && <Chart height={230} label="Error after n steps, both logarithmic" logarithmic logarithmic_x x={newest.horizon} ticks={newest.horizon} x_label="steps n" series={series} />}
    </Panel>
  );
}
