// A closed loop with its page: `plumb launch --dashboard` and where it listens.
import { spawn } from "node:child_process";
import { createInterface } from "node:readline";
import { build, source } from "./browser.mjs";

/** @param port of LCM, between 20000 and 40000; the bus has the port 20000 above it. `ended` is kept when all processes are gone. */
export async function startLoop(robot, options, folder, port) {
  const loop = spawn(`${build}/bin/plumb`, ["launch", `${source}/robots/${robot}`, "--dashboard", "127.0.0.1:0", "--output", `${folder}/run`, "--bus", `udp:239.74.163.2:${port + 20000}`,
    "--lcm-url", `udpm://239.255.76.67:${port}?ttl=0&recv_buf_size=2097152`, ...options], { stdio: ["ignore", "pipe", "inherit"] });
  const ended = new Promise((resolve) => loop.once("exit", resolve));
  for await (const line of createInterface({ input: loop.stdout })) {
    const address = /http:\/\/\S+/.exec(line)?.[0];
    if (!address) continue;
    loop.stdout.resume();
    return { loop, ended, address };
  }
  throw new Error("the loop has not said where its page is");
}
