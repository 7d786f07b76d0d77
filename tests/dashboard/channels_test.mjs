// The page's table of channels against what was said on LCM, and when.
import assert from "node:assert/strict";
import { spawn } from "node:child_process";
import { createInterface } from "node:readline";
import { test } from "node:test";
import { fileURLToPath } from "node:url";
import { build, clean, launch, look, numbers, PATIENCE, source } from "./browser.mjs";
import { startGateway, stop } from "./gateway.mjs";

/** The least and the most that `of` makes of the times that lie in the last two seconds before `end`, by how they are counted: in parts of half a second. */
function range(times, end, of) {
  const all = [];
  for (let length = 1.4; length <= 2.7; length += 0.05) {
    const within = times.filter((time) => time > end - length && time <= end);
    all.push(of(within, length));
  }
  return [Math.min(...all), Math.max(...all)];
}

function deviation(times) {
  const intervals = times.slice(1).map((time, i) => time - times[i]), mean = intervals.reduce((sum, one) => sum + one, 0) / intervals.length;
  return Math.sqrt(intervals.reduce((sum, one) => sum + (one - mean) ** 2, 0) / intervals.length);
}

test("what is said on a channel is counted, and how regularly, and what does not decode", { timeout: 2 * PATIENCE }, async () => {
  const sender = spawn("/usr/bin/python3", [fileURLToPath(new URL("steady_sender.py", import.meta.url)), `${build}/lcmtypes/python`], { stdio: ["pipe", "pipe", "inherit"] });
  const said = [];
  const url = await new Promise((resolve) => createInterface({ input: sender.stdout }).on("line", (line) => (line.startsWith("udpm") ? resolve(line) : said.push(JSON.parse(line)))));
  const [gateway, address] = await startGateway(`${source}/robots/pendulum`, "127.0.0.1:0", url);
  const browser = await launch();
  try {
    const seen = await look(browser, address);
    sender.stdin.write("begin\n");
    await seen.page.waitForFunction(() => Number(document.querySelectorAll('[data-channel="ROBOT_STATE"] td')[1]?.dataset.value) >= 40);
    const [, count, rate, jitter, bytes, undecodable, refused] = await seen.page.locator('[data-channel="ROBOT_STATE"]').evaluate((row) => [...row.querySelectorAll("td")].map((cell) => Number(cell.dataset.value)));
    while (said.length < count) await seen.page.waitForTimeout(100); // its line is on its way
    const counted = said.slice(0, count), times = counted.map(([time]) => time), end = times.at(-1) + 0.02;
    assert.equal(undecodable, counted.filter(([, , whole]) => !whole).length);
    assert.equal(refused, 0);
    const [slow, fast] = range(times, end, (within, length) => within.length / length);
    assert.ok(rate >= 0.9 * slow && rate <= 1.1 * fast, `${rate} a second are shown, ${slow} to ${fast} were said`);
    const [even, odd] = range(times, end, deviation).map((one) => 1000 * one);
    assert.ok(jitter >= even - 10 && jitter <= odd + 10, `a jitter of ${jitter} ms is shown, it was ${even} to ${odd} ms`);
    // Of sizes there are two, one byte apart.
    const size = bytes / rate, whole = counted[0][1];
    assert.ok(size > whole - 1 && size < whole, `${size} bytes a message are shown, ${whole} or one less was said`);
    // How regularly the estimator works, whose results these are.
    const bins = (await numbers(seen.page, "processes")).map(([, , results]) => results), heard = bins.reduce((sum, one) => sum + one, 0) + 1;
    while (said.length < heard) await seen.page.waitForTimeout(100);
    const meant = Array(24).fill(0);
    for (let i = 1; i < heard; i++) meant[Math.floor(Math.log2((said[i][0] - said[i - 1][0]) * 1e6))]++;
    // Of 40 ms and 160 ms; what comes late may be in a bin further up.
    bins.forEach((results, bin) => assert.ok(Math.abs(results - meant[bin]) <= 2 + 0.1 * heard, `${results} intervals of 2^${bin} us are shown, ${meant[bin]} were said`));
    clean(seen);
  } finally {
    await browser.close();
    await stop(gateway);
    await stop(sender);
  }
});
