import { DRIVER_STATES, SENSOR_STATES } from "../events";
import type { bus_status_t, driver_status_t } from "../messages";
import { Counters, type Names } from "../parts/counters";
import { type Cell, Panel, Table } from "../parts/panel";
import { driver, estimator } from "../run";

const COUNTERS: Names<driver_status_t> = [
  ["cycles", "cycles"], ["missed deadlines", "overruns", "bad"], ["measurements lost", "measurements_lost", "bad"], ["commands accepted", "commands_accepted"],
  ["commands rejected", "commands_rejected", "bad"], ["commands expired", "commands_expired"], ["commands limited", "commands_limited"], ["commands forged", "commands_forged", "bad"],
  ["setpoints saturated", "setpoints_saturated", "bad"], ["messages rejected", "messages_rejected", "bad"],
];

const FRAMES: Names<bus_status_t> = [
  ["frames received", "frames_received"], ["frames sent", "frames_sent"], ["frames rejected", "frames_rejected", "bad"], ["frames dropped", "frames_dropped", "bad"], ["frames of a stranger", "frames_foreign", "bad"],
];

export function BusPanel() {
  const d = driver.value, e = estimator.value;
  const trusted = (i: number): Cell[] => [e?.position_nis[i], e?.velocity_nis[i], e?.acceleration_nis[i]];
  return (
    <Panel id="bus" size="full" title="Buses, drives and sensors" empty={!d && "The driver has said nothing yet."}
      what="The state of each CAN bus and drive, what they report of themselves, everything that was counted since the driver's start, and how far the observer trusts each joint (1 on average if noise is as described).">
      {d && (
        <>
          {d.buses.map((bus) => (
            <div key={bus.url} data-bus={bus.url}>
              <p class="line"><i class={`lamp ${bus.up ? "good" : "bad"}`} />{bus.name && `${bus.name}: `}<b>{bus.url}</b> is {bus.up ? "up" : `down${d.reason && `: ${d.reason}`}`}</p>
              <Counters channel="bus" message={bus} names={FRAMES} />
            </div>
          ))}
          {d.commands_signed && <p class="line">Only commands that are signed with its key are obeyed.</p>}
          <Counters channel="DRIVER_STATUS" message={d} names={COUNTERS} />
          <Table shown caption="Drives" columns={["joint", "drive", "motor [°C]", "power stage [°C]", "supply [V]", "supply [A]", "calls itself", "says"]}
            rows={d.joint_name.map((name, i) => [name, DRIVER_STATES[d.joint_state[i] ?? 0] ?? "", d.motor_temperature[i], d.drive_temperature[i], d.bus_voltage[i], d.bus_current[i], d.drive_identity[i], d.joint_reason[i]])} />
          {d.num_sensors > 0 && (
            <Table shown caption="Sensors" columns={["sensor", "state", "says"]} rows={d.sensor_name.map((name, i) => [name, SENSOR_STATES[d.sensor_state[i] ?? 0] ?? "", d.sensor_reason[i]])} />
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
