import { signal } from "@preact/signals";
import { state } from "./connection";
import { StopButton } from "./controls";
import { DRIVER_STATES } from "./events";
import { seconds, times } from "./format";
import { now } from "./parts/age";
import { Choice } from "./parts/panel";
import { driver, gateway, lastHeard, robot } from "./run";
import { chooseTheme, theme } from "./theme";

const OLD_AFTER = 3000; // [ms] the gateway speaks once a second
export const helping = signal(false);

function Clock() {
  const g = gateway.value;
  if (!g) return null;
  const speed = g.speed === null ? "" : `, ${times(g.speed)} times real time`;
  const words = { real: "live", virtual: `virtual time${speed}`, replay: `replay${speed}` }[g.clock];
  return <span class="chip" data-clock={g.clock} data-speed={g.speed ?? "null"}>{words}</span>;
}

export function Header() {
  const d = driver.value;
  const lost = state.value !== "open";
  return (
    <header class="bar">
      <a class="name" href="#robot"><svg viewBox="0 0 24 24" aria-hidden="true"><path d="M12 2v9" /><path d="M8 11h8l-4 11z" /></svg>{robot.value?.name ?? "Plumbline"}</a>
      <span class={`chip ${lost ? "bad" : "good"}`} data-connection={state.value}>{lost ? "not connected" : "connected"}</span>
      <Clock />
      {d && <span class={`chip driver state-${DRIVER_STATES[d.state] ?? ""}`} data-driver={DRIVER_STATES[d.state]} title={d.reason}>driver {DRIVER_STATES[d.state] ?? d.state}</span>}
      <span class="space" />
      <Choice name="Colours" options={["auto", "light", "dark"] as const} value={theme.value} choose={chooseTheme} />
      <button class="quiet help" aria-label="Keys" title="Keys: ?" onClick={() => (helping.value = true)}>?</button>
      <StopButton />
    </header>
  );
}

/** What is shown may not be so any more. */
export function Warning() {
  const silent = now.value - lastHeard.value;
  if (state.value === "lost") return <p class="warning" role="alert">Not connected. What is shown is what was heard last; the page comes back by itself. The robot may be moving.</p>;
  if (state.value === "open" && silent > OLD_AFTER) return <p class="warning" role="alert">Nothing has come for {seconds(silent / 1000)}: what is shown is old.</p>;
  const [here, there] = [robot.value?.name, driver.value?.robot];
  if (here && there && here !== there) return <p class="warning" role="alert">The driver that is heard is of {there}, and this page of {here}: numbers may be of the wrong joints. plumb-dashboard wants the robot of the run.</p>;
  return null;
}
