import { signal } from "@preact/signals";
import { seconds } from "../format";
import { channels, heard } from "../run";

/** The page's clock [ms], four times a second: ages grow without being told. */
export const now = signal(performance.now());
setInterval(() => (now.value = performance.now()), 250);

/** The age of a channel's newest message [s]: as the gateway says, and as long as it has said nothing since. Null: never heard. */
export function age(channel: string): number | null {
  const here = heard.get(channel);
  // The gateway's own are not counted.
  if (channel.startsWith("PLUMB_")) return here === undefined ? null : Math.max(0, now.value - here) / 1000;
  const counted = channels.value?.channels.find((one) => one.channel === channel);
  if (counted?.age_ms == null) return null;
  const since = Math.max(0, now.value - (heard.get("PLUMB_CHANNELS") ?? now.value));
  const told = (counted.age_ms + since) / 1000;
  // What came here since the gateway counted is younger than its count.
  return here !== undefined && now.value - here < since ? Math.max(0, now.value - here) / 1000 : told;
}

export function Age({ channel, old }: { channel: string; old: number }) {
  const value = age(channel);
  return <span class={value === null || value > old ? "age old" : "age"}>{value === null ? "never heard" : value < 0.1 ? "now" : seconds(value)}</span>;
}
