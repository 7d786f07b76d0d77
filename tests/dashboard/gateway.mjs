// plumb-dashboard itself, for tests of the page.
import { spawn } from "node:child_process";
import { createInterface } from "node:readline";
import { build, pageFolder } from "./browser.mjs";

/** @returns its process, and where it listens. */
export async function startGateway(robot, at, lcm) {
  const gateway = spawn(`${build}/bin/plumb-dashboard`, [robot, "--page", pageFolder, "--address", at, "--lcm-url", lcm], { stdio: ["ignore", "pipe", "inherit"] });
  for await (const line of createInterface({ input: gateway.stdout })) {
    const found = /http:\/\/\S+/.exec(line);
    if (found) return [gateway, found[0]];
  }
  throw new Error("the gateway has not come up");
}

export async function stop(process, signal = "SIGTERM") {
  const gone = new Promise((resolve) => process.once("exit", resolve));
  process.kill(signal);
  await gone;
}
