// How long the live page takes from its address to its first paint, and to its first numbers: a new browser context each time,
// so that nothing is cached; a gateway with a pendulum whose run goes on meanwhile.
//
//   node bench/first_paint.mjs [TIMES]
import { spawn } from "node:child_process";
import { mkdtempSync, rmSync } from "node:fs";
import { createServer } from "node:http";
import { build, launch, look, source } from "../tests/dashboard/browser.mjs";

const times = Number(process.argv[2] ?? 10);
const folder = mkdtempSync("/tmp/first_paint_");
const robot = `${source}/robots/pendulum`;
const run = spawn(`${build}/bin/plumb`, ["launch", robot, "--dashboard", "127.0.0.1:0", "--real-time", "--iterations", "1000", "--output", folder], { stdio: ["ignore", "pipe", "pipe"] });
const address = await new Promise((resolve) => {
  let said = "";
  const hear = (text) => {
    const found = (said += text).match(/http:\/\/127\.0\.0\.1:\d+\//);
    if (found) resolve(found[0]);
  };
  run.stdout.on("data", hear), run.stderr.on("data", hear);
});
const browser = await launch();
const PAINTED = () => performance.getEntriesByName("first-contentful-paint")[0]?.startTime;
// The reference: one line of text on a page of nothing else, by the same browser beside the same run.
const text = createServer((_, answer) => answer.setHeader("Content-Type", "text/html").end("<!doctype html><title>text</title><p>text"));
await new Promise((resolve) => text.listen(0, "127.0.0.1", resolve));
const painted = [], filled = [], plain = [];
for (let i = 0; i < times; ++i) {
  const { page } = await look(browser, address);
  await page.locator("#channels tbody tr").first().waitFor();
  filled.push(await page.evaluate(() => performance.now()));
  painted.push(await page.evaluate(PAINTED));
  await page.context().close();
  const reference = await (await browser.newContext()).newPage();
  await reference.goto(`http://127.0.0.1:${text.address().port}/`);
  await reference.waitForFunction(PAINTED);
  plain.push(await reference.evaluate(PAINTED));
  await reference.context().close();
}
const row = (what, all) => {
  all.sort((a, b) => a - b);
  console.log(`${what}: median ${Math.round(all[all.length >> 1])} ms, worst ${Math.round(all.at(-1))} ms of ${all.length}`);
};
row("first paint of a line of text alone", plain);
row("first paint", painted);
row("first numbers", filled);
await browser.close();
text.close();
const gone = new Promise((resolve) => run.once("exit", resolve));
run.kill("SIGINT");
await gone;
rmSync(folder, { recursive: true });
