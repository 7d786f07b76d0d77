import { clock } from "../format";
import { Panel } from "../parts/panel";
import { begin, events, gateway } from "../run";

export function EventsPanel() {
  const all = events.value;
  const since = gateway.value?.clock === "real" ? null : begin.value;
  return (
    <Panel id="events" title="Events" size="full" empty={!all.length && "Nothing has happened yet."}
      what={`What has happened, the newest first, ${since === null ? "by the clock" : "in minutes and seconds of the run as far as it is known here"}: changes of state, faults with their reasons, alarms, decisions.`}>
      <ol class="events" tabIndex={0} aria-label="Events">
        {all.map((one, i) => (
          <li key={`${one.time} ${one.text} ${all.length - i}`} class={one.weight}>
            <time>{clock(one.time, since)}</time><b>{one.from}</b><span>{one.text}</span>
          </li>
        ))}
      </ol>
    </Panel>
  );
}
