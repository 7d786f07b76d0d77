import { DRIVER_STATES, PHASES } from "../events";
import { grouped, number, seconds } from "../format";
import { driver_status_t } from "../messages";
import { Age } from "../parts/age";
import { Histogram, quantile } from "../parts/histogram";
import { type Cell, Panel, Table } from "../parts/panel";
import { calibrations, channels, controller, driver, estimator, gateway, trainings } from "../run";

interface Life {
  name: string;
  channel: string;
  old: number; // [s] an age that is too much: five times what is usual
  says: string;
  well: boolean | null;
}

function lives(): Life[] {
  const training = trainings.value[trainings.value.length - 1];
  const calibration = calibrations.value[calibrations.value.length - 1];
  const d = driver.value, e = estimator.value, c = controller.value;
  return [
    { name: "driver", channel: "DRIVER_STATUS", old: 0.5, says: d ? `${DRIVER_STATES[d.state] ?? d.state}${d.reason ? `: ${d.reason}` : ""}` : "", well: d && d.state !== driver_status_t.FAULT },
    { name: "estimator", channel: "ESTIMATOR_STATUS", old: 0.5, says: e ? (e.valid ? "the state is valid" : e.reason || "the state is not valid") : "", well: e && e.valid },
    { name: "controller", channel: "CONTROLLER_STATUS", old: 0.5, says: c ? `${PHASES[c.phase] ?? c.phase}${c.reason ? `: ${c.reason}` : ""}` : "", well: c && c.phase !== 4 },
    { name: "calibrator", channel: "CALIBRATION_STATUS", old: 5, says: calibration ? `iteration ${calibration.iteration}${calibration.streamed_transitions ? `, ${calibration.streamed_transitions} transitions heard of the next` : ""}` : "", well: calibration ? !calibration.alarm : null },
    // While it computes it says nothing between updates.
    { name: "trainer", channel: "TRAINING_STATUS", old: Infinity, says: training ? `policy ${training.iteration}, ${training.complete ? "complete" : `update ${training.update} of ${training.updates}`}` : "", well: training ? true : null },
  ];
}

export function ProcessesPanel() {
  const g = gateway.value;
  return (
    <Panel id="processes" title="Processes" what="Of each process how old its last word is, what it says of itself, and how many of its messages come in a second.">
      <div class="scroll" tabIndex={0} role="region" aria-label="Processes">
        <table>
          <thead><tr><th scope="col">process</th><th scope="col">last heard</th><th scope="col">says</th><th scope="col">messages/s</th></tr></thead>
          <tbody>
            {lives().map(({ name, channel, old, says, well }) => (
              <tr key={name} data-process={name}>
                <th scope="row"><i class={`lamp ${well === null ? "" : well ? "good" : "bad"}`} />{name}</th>
                <td><Age channel={channel} old={old} /></td>
                <td class="words">{says || "–"}</td>
                <td class="n">{number(channels.value?.channels.find((one) => one.channel === channel)?.rate, 3)}</td>
              </tr>
            ))}
            <tr data-process="gateway">
              <th scope="row"><i class={`lamp ${g ? "good" : ""}`} />gateway</th>
              <td><Age channel="PLUMB_GATEWAY" old={5} /></td>
              <td class="words">{g ? `${g.clients} ${g.clients === 1 ? "browser" : "browsers"}, ${grouped(g.dropped)} messages left out for slow ones` : "–"}</td>
              <td class="n">–</td>
            </tr>
          </tbody>
        </table>
      </div>
    </Panel>
  );
}

const COUNTERS: [name: string, of: keyof driver_status_t & string][] = [
  ["cycles", "cycles"], ["missed deadlines", "overruns"], ["frames received", "frames_received"], ["frames sent", "frames_sent"], ["frames rejected", "frames_rejected"],
  ["frames dropped", "frames_dropped"], ["frames of a stranger", "frames_foreign"], ["measurements lost", "measurements_lost"], ["commands accepted", "commands_accepted"],
  ["commands rejected", "commands_rejected"], ["commands expired", "commands_expired"], ["commands limited", "commands_limited"], ["commands forged", "commands_forged"],
  ["messages rejected", "messages_rejected"],
];

/** Of each phase its own bins: the matrix comes row after row. */
const phases = ({ phase_name, phase_duration, num_bins }: driver_status_t) =>
  phase_name.map((name, i): [string, number[]] => [name, phase_duration.slice(i * num_bins, (i + 1) * num_bins)]);

export function CyclePanel() {
  const d = driver.value;
  const share = (counts: number[], of: number) => seconds(quantile(counts, of));
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
            <b data-value={d.overruns}>{grouped(d.overruns)}</b> missed deadlines in <b data-value={d.cycles}>{grouped(d.cycles)}</b> cycles; half of them less than {share(d.lateness, 0.5)} late,
            all but one in a hundred less than {share(d.lateness, 0.99)}, all less than {share(d.lateness, 1)}.
          </p>
          <Histogram counts={d.lateness} label={`Lateness of ${d.cycles} cycles: median below ${share(d.lateness, 0.5)}, longest below ${share(d.lateness, 1)}`} />
          <div class="scroll" tabIndex={0} role="region" aria-label="Phases of a cycle">
          <table class="phases">
            <thead><tr><th scope="col">phase</th><th scope="col">how long</th><th scope="col">half below</th><th scope="col">99 %</th><th scope="col">all</th></tr></thead>
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

export function BusPanel() {
  const d = driver.value, e = estimator.value;
  const trusted = (i: number): Cell[] => [e?.position_nis[i], e?.velocity_nis[i], e?.acceleration_nis[i]];
  return (
    <Panel id="bus" size="full" title="Bus, drives and sensors" empty={!d && "The driver has said nothing yet."}
      what="The state of the CAN bus and of each drive, what they report of themselves, everything that was counted since the driver's start, and how far the observer trusts each joint (1 on average if noise is as described).">
      {d && (
        <>
          <p class="line"><i class={`lamp ${d.bus_up ? "good" : "bad"}`} /><b>{d.bus}</b> is {d.bus_up ? "up" : "down"}</p>
          <dl class="counters">
            {COUNTERS.map(([name, of]) => (
              <div key={of} class={/rejected|dropped|stranger|lost|forged|missed/.test(name) && d[of] ? "bad" : ""}>
                <dt>{name}</dt><dd data-counter={of} data-value={d[of] as number}>{grouped(d[of] as number)}</dd>
              </div>
            ))}
          </dl>
          <Table shown caption="Drives" columns={["joint", "drive", "motor [°C]", "power stage [°C]", "supply [V]", "says"]}
            rows={d.joint_name.map((name, i) => [name, DRIVER_STATES[d.joint_state[i] ?? 0] ?? "", d.motor_temperature[i], d.drive_temperature[i], d.bus_voltage[i], d.joint_reason[i]])} />
          {d.num_sensors > 0 && (
            <Table shown caption="Sensors" columns={["sensor", "state", "says"]} rows={d.sensor_name.map((name, i) => [name, ["absent", "starting", "running", "fault"][d.sensor_state[i] ?? 0] ?? "", d.sensor_reason[i]])} />
          )}
          {e && (
            <Table shown caption="What the observer makes of its readings" columns={["joint", "age [s]", "position", "velocity", "acceleration", "bias", "says"]}
              rows={e.joint_name.map((name, i) => [name, e.age[i], ...trusted(i), e.bias[i], e.joint_reason[i]])} />
          )}
        </>
      )}
    </Panel>
  );
}
