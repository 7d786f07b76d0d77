import { bytes, grouped, number } from "../format";
import { Age } from "../parts/age";
import { Panel } from "../parts/panel";
import { channels } from "../run";

export function ChannelsPanel() {
  const all = channels.value?.channels ?? [];
  return (
    <Panel id="channels" title="Channels" size="full" empty={!channels.value && "Nothing has been counted yet."}
      what="Every LCM channel: how many messages have come, how many a second, how regularly (jitter: standard deviation of the time between two), how many bytes, how many could not be decoded, and how many were refused, as they are not signed with the key.">
      <div class="scroll" tabIndex={0} role="region" aria-label="Channels">
        <table class="wide">
          <thead>
            <tr>{["channel", "type", "messages", "per second", "jitter [ms]", "bytes/s", "undecodable", "refused", "last"].map((one) => <th scope="col" key={one}>{one}</th>)}</tr>
          </thead>
          <tbody>
            {all.map((one) => (
              <tr key={one.channel} data-channel={one.channel} class={one.count ? "" : "unheard"}>
                <th scope="row">{one.channel}</th>
                <td>{one.type}</td>
                <td class="n" data-value={one.count}>{grouped(one.count)}</td>
                <td class="n" data-value={one.rate ?? "null"}>{number(one.rate, 3)}</td>
                <td class="n" data-value={one.jitter_ms ?? "null"}>{number(one.jitter_ms, 2)}</td>
                <td class="n" data-value={one.bytes_per_second ?? "null"}>{bytes(one.bytes_per_second)}</td>
                <td class={one.undecodable ? "n bad" : "n"} data-value={one.undecodable}>{grouped(one.undecodable)}</td>
                <td class={one.refused ? "n bad" : "n"} data-value={one.refused}>{grouped(one.refused)}</td>
                <td><Age channel={one.channel} old={Infinity} /></td>
              </tr>
            ))}
          </tbody>
        </table>
      </div>
    </Panel>
  );
}
