import { DRIVER_STATES, PHASES } from "../events";
import { grouped, number } from "../format";
import { controller_status_t, driver_status_t } from "../messages";
import { Age } from "../parts/age";
import { Histogram, quantile } from "../parts/histogram";
import { type Cell, Panel } from "../parts/panel";
import { calibrations, channels, controller, driver, estimator, gateway, trainings } from "../run";

interface Life {
  name: string;
  channel: string;
  result: string | null; // the channel on which it speaks once a cycle
  old: number; // [s] an age that is too much: five times what is usual
  says: string;
  well: boolean | null;
}

function lives(): Life[] {
  const training = trainings.value[trainings.value.length - 1];
  const calibration = calibrations.value[calibrations.value.length - 1];
  const d = driver.value, e = estimator.value, c = controller.value;
  return [
    { name: "driver", channel: "DRIVER_STATUS", result: "JOINT_STATE", old: 0.5, says: d ? `${DRIVER_STATES[d.state] ?? d.state}${d.reason ? `: ${d.reason}` : ""}` : "", well: d && d.state !== driver_status_t.FAULT },
    { name: "estimator", channel: "ESTIMATOR_STATUS", result: "ROBOT_STATE", old: 0.5, says: e ? (e.valid ? "the state is valid" : e.reason || "the state is not valid") : "", well: e && e.valid },
    { name: "controller", channel: "CONTROLLER_STATUS", result: "JOINT_COMMAND", old: 0.5, says: c ? `${PHASES[c.phase] ?? c.phase}${c.reason ? `: ${c.reason}` : ""}` : "", well: c && c.phase !== controller_status_t.HALTED },
    { name: "calibrator", channel: "CALIBRATION_STATUS", result: null, old: 5, says: calibration ? `iteration ${calibration.iteration}${calibration.alarm ? ", the model does not explain the robot" : ""}${calibration.streamed_transitions ? `, ${calibration.streamed_transitions} transitions heard of the next` : ""}` : "", well: calibration ? !calibration.alarm : null },
    // While it computes it says nothing between updates.
    { name: "trainer", channel: "TRAINING_STATUS", result: null, old: Infinity, says: training ? `policy ${training.iteration}, ${training.complete ? "complete" : `update ${training.update} of ${training.updates}`}` : "", well: training ? true : null },
  ];
}

const counted = (channel: string | null) => channels.value?.channels.find((one) => one.channel === channel);

/** How long a process takes from one result to the next. */
function Cycle({ name, result }: { name: string; result: string | null }) {
  const intervals = counted(result)?.intervals;
  const most = intervals && quantile(intervals, 0.99);
  if (!intervals || most == null) return <>–</>;
  return <><Histogram small counts={intervals} label={`Time between two results of the ${name}`} />99 % {most}</>;
}

export function ProcessesPanel() {
  const g = gateway.value;
  const cyclic = lives().filter(({ result }) => result);
  return (
    <Panel id="processes" title="Processes" what="Of each process how old its last word is, what it says of itself, how many of its messages come in a second, and how long it takes from one result to the next (counted in bins that double)."
      numbers={() => [{
        caption: "Results by the time since the one before: the bin's lower end", columns: ["from [µs]", ...cyclic.map(({ name }) => name)],
        rows: Array.from({ length: Math.max(0, ...cyclic.map(({ result }) => counted(result)?.intervals.length ?? 0)) }, (_, i): Cell[] => [2 ** i, ...cyclic.map(({ result }) => counted(result)?.intervals[i])]),
      }]}>
      <div class="scroll" tabIndex={0} role="region" aria-label="Processes">
        <table>
          <thead><tr><th scope="col">process</th><th scope="col">last heard</th><th scope="col">says</th><th scope="col">messages/s</th><th scope="col">between results</th></tr></thead>
          <tbody>
            {lives().map(({ name, channel, result, old, says, well }) => (
              <tr key={name} data-process={name}>
                <th scope="row"><i class={`lamp ${well === null ? "" : well ? "good" : "bad"}`} />{name}</th>
                <td><Age channel={channel} old={old} /></td>
                <td class="words">{says || "–"}</td>
                <td class="n">{number(counted(channel)?.rate, 3)}</td>
                <td class="n"><Cycle name={name} result={result} /></td>
              </tr>
            ))}
            <tr data-process="gateway">
              <th scope="row"><i class={`lamp ${g ? "good" : ""}`} />gateway</th>
              <td><Age channel="PLUMB_GATEWAY" old={5} /></td>
              <td class="words">{g ? `${g.clients} ${g.clients === 1 ? "browser" : "browsers"}, ${grouped(g.dropped)} messages left out for slow ones` : "–"}</td>
              <td class="n">–</td>
              <td class="n">–</td>
            </tr>
          </tbody>
        </table>
      </div>
    </Panel>
  );
}

/** Of each phase its own bins: the matrix comes row after row. */
const phases = ({ phase_name, phase_duration, num_bins }: driver_status_t) =>
  phase_name.map((name, i): [string, number[]] => [name, phase_duration.slice(i * num_bins, (i + 1) * num_bins)]);

export function CyclePanel() {
  const d = driver.value;
  const share = (counts: number[], of: number) => quantile(counts, of) ?? "–";
  return (
    <Panel id="cycle" title="The driver's cycle" empty={!d && "The driver has said nothing yet."}
      what="How late the driver's cycles began, and how long each phase of a cycle took, since its start: counted in bins that double, drawn on a logarithmic scale."
      numbers={() => [{
        caption: "Cycles and phases by duration: the bin's lower end", columns: ["from [µs]", "late", ...d!.phase_name],
        rows: d!.lateness.map((count, i): Cell[] => [2 ** i, count, ...phases(d!).map(([, counts]) => counts[i])]),
      }]}>
      {d && (
        <>
          <p class="line">
            <b data-value={d.overruns}>{grouped(d.overruns)}</b> missed deadlines in <b data-value={d.cycles}>{grouped(d.cycles)}</b> cycles.{" "}
            How late they began: half of them {share(d.lateness, 0.5)}, 99 % {share(d.lateness, 0.99)}, the latest {share(d.lateness, 1)}.
          </p>
          <Histogram counts={d.lateness} label={`Lateness of ${d.cycles} cycles: median ${share(d.lateness, 0.5)}, longest ${share(d.lateness, 1)}`} />
          <div class="scroll" tabIndex={0} role="region" aria-label="Phases of a cycle">
          <table class="phases">
            <thead><tr><th scope="col">phase</th><th scope="col">how long</th><th scope="col">half</th><th scope="col">99 %</th><th scope="col">longest</th></tr></thead>
            <tbody>
              {phases(d).map(([name, counts]) => (
                <tr key={name}>
                  <th scope="row">{name}</th>
                  <td><Histogram small counts={counts} label={`Durations of ${name}`} /></td>
                  <td class="n">{share(counts, 0.5)}</td><td class="n">{share(counts, 0.99)}</td><td class="n">{share(counts, 1)}</td>
                </tr>
              ))}
            </tbody>
          </table>
          </div>
        </>
      )}
    </Panel>
  );
}
