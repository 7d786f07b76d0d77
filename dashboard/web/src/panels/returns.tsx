import type { Value } from "../contract";
import { number } from "../format";
import { Chart } from "../parts/chart";
import { Key, Panel } from "../parts/panel";
import { type controller_status_t, policy_t } from "../messages";
import { outcomes, robot, trainings } from "../run";

interface Episode {
  steps: Value;
  said: Value; // the sum of its rewards
  whole: Value; // what it would have been over a whole episode
}

interface Outcome {
  policy: number;
  robot: Episode[];
  simulated: Value;
  tenth: Value;
  worst: Value;
}

const mean = (of: Episode[]): Value => {
  const given = of.map(({ whole }) => whole).filter((value): value is number => value !== null);
  return given.length ? given.reduce((sum, value) => sum + value, 0) / given.length : null;
};

/** Its episodes. A trial that time has cut off counts on at its late rate, as where policies are compared (controller/trial.h). */
function episodes({ returns, steps, late_rate, fell }: controller_status_t): Episode[] {
  const longest = robot.value?.task?.steps;
  return returns.map((said, i) => {
    const lasted = steps[i] ?? null, rate = late_rate[i] ?? null;
    const cut = said !== null && lasted !== null && rate !== null && longest !== undefined && !fell[i] && lasted < longest;
    return { steps: lasted, said, whole: cut ? said + rate * (longest - lasted) : said };
  });
}

/** The iteration in which its policy was trained: in the last one the robot is run with the incumbent, which may be an earlier one's. */
function trainedIn({ policy_iteration, purpose }: controller_status_t): number {
  const said = purpose === policy_t.EVALUATE ? trainings.value.findLast((one) => one.iteration === policy_iteration && one.complete) : undefined;
  return said && said.incumbent >= 0 ? said.incumbent : policy_iteration;
}

/** What each policy has returned: in simulation when its training was complete, and on the robot. */
function byPolicy(): Outcome[] {
  const found = new Map<number, Outcome>();
  const of = (policy: number) => {
    if (!found.has(policy)) found.set(policy, { policy, robot: [], simulated: null, tenth: null, worst: null });
    return found.get(policy)!;
  };
  for (const status of outcomes.value) if (status.returns.length) of(trainedIn(status)).robot.push(...episodes(status));
  for (const one of trainings.value) {
    if (one.complete) Object.assign(of(one.iteration), { simulated: one.evaluation_return, tenth: one.evaluation_tenth, worst: one.evaluation_worst });
  }
  return [...found.values()].sort((a, b) => a.policy - b.policy);
}

export function ReturnsPanel() {
  const all = byPolicy();
  // Where several episodes were made each is a point of its own.
  const x: number[] = [], robot: Value[] = [], mine: Value[] = [], simulated: Value[] = [], tenth: Value[] = [], worst: Value[] = [];
  for (const one of all) {
    const dots = one.robot.length ? one.robot.map(({ whole }) => whole) : [null];
    dots.forEach((value, i) => {
      const first = i === 0;
      x.push(one.policy);
      robot.push(value);
      mine.push(first ? mean(one.robot) : null);
      simulated.push(first ? one.simulated : null);
      tenth.push(first ? one.tenth : null);
      worst.push(first ? one.worst : null);
    });
  }
  const decision = trainings.value.findLast((one) => one.decision)?.decision;
  return (
    <Panel id="returns" size="third" title="Return: robot and simulation" empty={!all.length && "No policy has been judged yet."}
      what="What each policy earns in an episode: on simulators held out (mean, the worst tenth shaded), and on the robot, each episode a dot; a trial that was cut short counts as a whole episode at its late rate."
      numbers={() => [
        { caption: "Return by policy", columns: ["policy", "robot, mean", "episodes", "simulation", "tenth", "worst"], rows: all.map((one) => [one.policy, mean(one.robot), one.robot.length, one.simulated, one.tenth, one.worst]) },
        { caption: "Episodes on the robot", columns: ["policy", "episode", "steps", "return", "of a whole one"], rows: all.flatMap((one) => one.robot.map(({ steps, said, whole }, i) => [one.policy, i + 1, steps, said, whole])) },
      ]}>
      <Key items={[["robot", "robot, mean"], ["robot dot", "its episodes"], ["simulation", "simulation"], ["simulation dash", "its worst"]]} />
      <Chart height={230} whole label={`Return of ${all.length} policies; the newest: ${number(all[all.length - 1]?.simulated)} in simulation, ${number(mean(all[all.length - 1]?.robot ?? []))} on the robot`}
        x={x} x_label="policy"
        series={[
          { label: "simulation", values: simulated, colour: "simulation", points: true, width: 2, to: "tenth" },
          { label: "tenth", values: tenth, colour: "simulation", width: 0, points: false },
          { label: "worst", values: worst, colour: "simulation", width: 1, dash: [3, 3], points: false },
          { label: "episodes", values: robot, colour: "robot", opacity: 0.45, width: 0, points: true },
          { label: "robot", values: mine, colour: "robot", width: 2, points: true },
        ]} />
      {decision && <p class="line">{decision}</p>}
    </Panel>
  );
}
