import { useMemo } from "preact/hooks";
import { number } from "../format";
import type { residual_function_t } from "../messages";
import { Chart } from "../parts/chart";
import { Key, Panel, Table } from "../parts/panel";
import { learnt } from "../residual";
import { calibrations, distribution, robot } from "../run";

const WHERE = ["free", "touching", "each contact with the ground", "each joint at a stop"];

function outputs({ condition, num_outputs }: residual_function_t): string[] {
  const named = condition < 2 ? robot.value : null;
  const half = num_outputs / 2;
  return Array.from({ length: num_outputs }, (_, i) => {
    const of = i < half ? named?.coordinates[i] : named?.velocities[i - half];
    return of ? `${of.name} [${of.unit ?? "1"}]` : `${i < half ? "position" : "velocity"} ${1 + (i % half)}`;
  });
}

/** One residual: of each output what is learnt and what is left, each bar by the largest change that was allowed. */
function Residual({ residual }: { residual: residual_function_t }) {
  const { change, noise } = useMemo(() => learnt(residual), [residual]);
  const names = outputs(residual);
  return (
    <Table shown caption={`Steps: ${WHERE[residual.condition] ?? residual.condition}, by ${residual.num_centres} recorded states`}
      columns={["change of", "learnt, rms", "left, sd", "at most"]} rows={names.map((name, i) => [name, change[i], noise[i], residual.bound[i]])} />
  );
}

export function GapPanel() {
  const all = calibrations.value.filter((one) => one.iteration > 0);
  const newest = calibrations.value[calibrations.value.length - 1];
  const residuals = distribution.value?.residual ?? [];
  return (
    <Panel id="gap" size="full" title="Whether the model explains the robot" empty={!newest && "The calibrator has said nothing yet."}
      what="What the alarm says, what the simulator was found to lack and what was learnt of that; the discrepancy is the squared error of a step in units of its uncertainty: 1 is explained down to the noise."
      numbers={() => [{
        caption: "Discrepancy", columns: ["iteration", "posterior", "prior"],
        rows: all.map((one) => [one.iteration, one.discrepancy, one.prior_discrepancy]),
      }]}>
      <div class="split">
      <div>
      <p class={`verdict ${newest?.alarm ? "bad" : newest?.gap ? "" : "good"}`} data-alarm>
        <b>{newest?.alarm ? "Alarm" : newest?.gap ? "Not known" : all.length ? "No alarm" : "Nothing to judge yet"}</b>
        {newest?.alarm || newest?.gap || (all.length ? "The model explains what was recorded." : "No roll-out has been recorded.")}
      </p>
      {newest?.alarm && newest.gap && <p class="line">{newest.gap}</p>}
      {newest?.identifiability && <p class="line">{newest.identifiability}.</p>}
      {!!newest?.num_combinations && (
        <Table shown caption="What the motion determines" columns={["combination", "mean", "sd"]} rows={newest.combination.map((name, i) => [name, newest.combination_mean[i], newest.combination_sd[i]])} />
      )}
      </div>
      <div>
      {all.length > 0 && (
        <>
          <Key items={[["posterior", "posterior's mean"], ["prior dash", "prior's mean"]]} />
          <Chart height={130} whole logarithmic label={`Discrepancy over the iterations, now ${number(newest?.discrepancy)}`} x={all.map((one) => one.iteration)} line={{ at: 1, colour: "good", label: "noise" }}
            series={[
              { label: "posterior", values: all.map((one) => one.discrepancy), colour: "posterior", points: true, width: 2 },
              { label: "prior", values: all.map((one) => one.prior_discrepancy), colour: "prior", dash: [5, 3] },
            ]} />
        </>
      )}
      {residuals.map((one) => <Residual key={one.condition} residual={one} />)}
      </div>
      </div>
    </Panel>
  );
}
