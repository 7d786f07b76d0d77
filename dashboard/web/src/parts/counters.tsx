import { grouped } from "../format";

export type Names<T> = [name: string, of: keyof T & string, bad?: "bad"][];

/** What a process has counted since its start; what is bad if it has happened at all is said so. @param channel of `message`. */
export function Counters<T extends object>({ channel, message, names }: { channel: string; message: T; names: Names<T> }) {
  return (
    <dl class="counters" data-of={channel}>
      {names.map(([name, of, bad]) => (
        <div key={of} class={bad && message[of] ? "bad" : ""}>
          <dt>{name}</dt><dd data-counter={of} data-value={message[of] as number}>{grouped(message[of] as number)}</dd>
        </div>
      ))}
    </dl>
  );
}
