// How long an emergency stop takes from the key at the page to the driver, and to the answer on the page: a browser that draws
// 500 states a second, and as many smoothed ones, beside a client that has asked for everything and reads nothing.
//
//   node bench/emergency_stop.mjs [TIMES]
import { spawn } from "node:child_process";
import { createRequire } from "node:module";
import { createInterface } from "node:readline";
import { build, launch, look, source, stall } from "../tests/dashboard/browser.mjs";

const WebSocket = createRequire(new URL("../dashboard/web/package.json", import.meta.url))("ws");
const times = Number(process.argv[2] ?? 30);
const robot = `${source}/robots/pendulum`;
const ARMED = 3; // of driver_status_t

const processes = [];
function start(program, ...options) {
  const process = spawn(program, options, { stdio: ["ignore", "pipe", "ignore"] });
  processes.push(process);
  return process;
}
async function firstLine(process, pattern) {
  for await (const line of createInterface({ input: process.stdout })) {
    const found = pattern.exec(line);
    if (found) return found[0];
  }
  throw new Error(`${process.spawnfile} has ended`);
}

/** Who arms, and hears when the driver has disarmed. */
async function connect(address) {
  const socket = new WebSocket(address.replace("http", "ws"), "foxglove.websocket.v1");
  const services = new Map();
  const waiting = { answer: () => {}, status: () => {} };
  let calls = 0;
  socket.on("message", (data, binary) => {
    const message = binary ? null : JSON.parse(data);
    for (const { id, name } of message?.services ?? []) services.set(name, id);
    for (const { id, topic } of message?.channels ?? []) if (topic === "DRIVER_STATUS") socket.send(JSON.stringify({ op: "subscribe", subscriptions: [{ id, channelId: id }] }));
    if (binary && data[0] === 1) waiting.status(JSON.parse(data.subarray(13)));
    if (binary && data[0] === 3) waiting.answer(JSON.parse(data.subarray(17)));
  });
  await new Promise((resolve) => socket.on("message", () => services.size && resolve()));
  const call = (name) => {
    const head = Buffer.alloc(13);
    head.writeUInt8(2, 0), head.writeUInt32LE(services.get(name), 1), head.writeUInt32LE(++calls, 5), head.writeUInt32LE(4, 9);
    socket.send(Buffer.concat([head, Buffer.from("json{}")]));
    return new Promise((resolve) => (waiting.answer = resolve));
  };
  const until = (so) => new Promise((resolve) => (waiting.status = (status) => so(status) && resolve(status)));
  return { call, until, close: () => socket.terminate() };
}

const speaker = start(`${source}/bench/dashboard`, "--speak");
const url = await firstLine(speaker, /udpm:\S+/);
const bus = ["--bus", `udp:239.74.163.61:${/:(\d+)\?/.exec(url)[1]}`, "--lcm-url", url];
start(`${build}/bin/plumb-robot`, robot, ...bus);
start(`${build}/bin/plumb-driver`, robot, ...bus, "--virtual");
const address = await firstLine(start(`${build}/bin/plumb-dashboard`, robot, "--address", "127.0.0.1:0", "--lcm-url", url), /http:\S+/);
const stalled = await stall(address);
const watcher = await connect(address);
const browser = await launch();
const { page } = await look(browser, address);
await page.evaluate(() => addEventListener("keydown", ({ timeStamp }) => {
  const pressed = performance.timeOrigin + timeStamp;
  const answered = () => document.querySelector(".outcome .done") && resolve({ pressed, shown: performance.timeOrigin + performance.now() });
  let resolve;
  globalThis.stop = new Promise((to) => (resolve = to)).finally(() => watch.disconnect());
  const watch = new MutationObserver(answered);
  watch.observe(document.body, { subtree: true, childList: true });
}, { capture: true }));

const disarmed = [], shown = [];
while (disarmed.length < times) {
  if (!(await watcher.call("arm")).ok) continue; // the driver's start guard, say
  const stopped = watcher.until((status) => status.state !== ARMED && status.stopped_by_request);
  await page.keyboard.press("Escape");
  const { utime } = await stopped;
  const { pressed, shown: then } = await page.evaluate(() => globalThis.stop);
  disarmed.push(utime / 1000 - pressed);
  shown.push(then - pressed);
  await page.getByRole("button", { name: "Close this message" }).click();
  await page.locator(".outcome .done").waitFor({ state: "detached" });
}
for (const [what, all] of [["the driver has disarmed", disarmed], ["the page says so", shown]]) {
  all.sort((a, b) => a - b);
  console.log(`emergency stop, ${times} times: ${what} after ${all[times >> 1].toFixed(1)} ms (median), ${all.at(-1).toFixed(1)} ms (worst)`);
}
stalled.destroy();
watcher.close();
await browser.close();
for (const process of processes) process.kill();
