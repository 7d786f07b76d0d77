// The way to the gateway: a WebSocket that comes back by itself, what is listened to, and what is asked for.
import { signal } from "@preact/signals";
// Its other half, for servers, is not wanted here.
import FoxgloveClient from "@foxglove/ws-protocol/dist/esm/src/FoxgloveClient";
import type { Answer, Service } from "./contract";

export type State = "connecting" | "open" | "lost";
/** Of the connection, not of the robot. */
export const state = signal<State>("connecting");
/** Services that the gateway offers now. */
export const services = signal<readonly string[]>([]);

/** A message of a topic: its JSON, and when the gateway had it [us]. */
export type Listener = (json: DataView, time: number) => void;

const RETRY_AFTER = 1000; // [ms]
const ANSWER_WITHIN = 6000; // [ms] the driver is given three seconds by the gateway
const DOWN = "The page has no connection to the robot's computer. Use the robot's own emergency stop.";

interface Open {
  client: FoxgloveClient;
  offered: [topic: string, id: number][]; // that are listened to
  topics: Map<number, string>; // by subscription
  begin: () => void;
  serviceIds: Map<string, number>;
  waiting: Map<number, (answer: Answer) => void>; // by call
}

let open: Open | null = null;
let calls = 0;

/** Connects, and again whenever the connection ends. `begin` is called before the first message of each connection. */
export function connect(url: string, listeners: Map<string, Listener>, begin: () => void) {
  const socket = new WebSocket(url, [FoxgloveClient.SUPPORTED_SUBPROTOCOL]);
  // Of what the client sets on a socket, its types know less than the browser's do.
  const client = new FoxgloveClient({ ws: socket as never });
  const here: Open = { client, offered: [], topics: new Map(), begin, serviceIds: new Map(), waiting: new Map() };

  client.on("serverInfo", () => {
    open = here;
    begin();
    state.value = "open";
  });
  client.on("advertise", (channels) => {
    for (const { id, topic } of channels) {
      if (!listeners.has(topic)) continue;
      here.offered.push([topic, id]);
      here.topics.set(client.subscribe(id), topic);
    }
  });
  client.on("advertiseServices", (offered) => {
    for (const { id, name } of offered) here.serviceIds.set(name, id);
    services.value = [...here.serviceIds.keys()];
  });
  client.on("message", ({ subscriptionId, data, timestamp }) => {
    const topic = here.topics.get(subscriptionId);
    if (topic) listeners.get(topic)?.(data as DataView, Number(timestamp / 1000n));
  });
  client.on("serviceCallResponse", ({ callId, data }) => {
    here.waiting.get(callId)?.(JSON.parse(new TextDecoder().decode(data)) as Answer);
  });
  client.on("serviceCallFailure", ({ callId, message }) => here.waiting.get(callId)?.({ ok: false, text: message }));
  client.on("error", () => {}); // a close follows it
  client.on("close", () => {
    if (open === here) open = null;
    for (const answer of here.waiting.values()) answer({ ok: false, text: `The connection ended before there was an answer. ${DOWN}` });
    services.value = [];
    state.value = "lost";
    setTimeout(() => connect(url, listeners, begin), RETRY_AFTER);
  });
}

/** Hears all that the gateway keeps once more, as after a new connection. */
export function renew() {
  if (!open) return;
  const { client, offered, topics, begin } = open;
  for (const subscription of topics.keys()) client.unsubscribe(subscription);
  topics.clear();
  begin();
  for (const [topic, id] of offered) topics.set(client.subscribe(id), topic);
}

/** Asks for a service. Never throws: what went wrong is in the answer. */
export function ask(service: Service): Promise<Answer> {
  const id = open?.serviceIds.get(service);
  if (!open || id === undefined) {
    return Promise.resolve({ ok: false, text: open ? "The gateway does not offer that." : DOWN });
  }
  const { client, waiting } = open;
  const callId = ++calls;
  return new Promise((resolve) => {
    const answer = (given: Answer) => {
      clearTimeout(late);
      waiting.delete(callId);
      resolve(given);
    };
    const late = setTimeout(() => answer({ ok: false, text: "No answer came. Use the robot's own emergency stop." }), ANSWER_WITHIN);
    waiting.set(callId, answer);
    const nothing = new TextEncoder().encode("{}");
    client.sendServiceCallRequest({ serviceId: id, callId, encoding: "json", data: new DataView(nothing.buffer) });
  });
}
