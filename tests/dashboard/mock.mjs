// A gateway that makes its data up, for the page's development and for states that a run reaches rarely: an alarm with a learnt
// residual, a wish to place the robot, a robot that may be controlled. `node mock.mjs FOLDER [PORT]` serves the page in FOLDER.
import { createServer } from "node:http";
import { readFileSync } from "node:fs";
import { createRequire } from "node:module";
import { pathToFileURL } from "node:url";

const { WebSocketServer } = createRequire(new URL("../../dashboard/web/package.json", import.meta.url))("ws");
const TYPES = { html: "text/html", js: "text/javascript", css: "text/css", svg: "image/svg+xml", json: "application/json" };
const SERVICES = ["emergency_stop", "arm", "disarm", "confirm_placed"];
const BEGIN = 1_700_000_000_000_000;

const PARAMETERS = [["gravity", "m/s^2", 10.4, 0.57, 10.418], ["mass/pole", "kg", 1.04, 0.18, 1.078], ["length/pole", "m", 1.04, 0.18, 1.1027], ["friction/pivot", "Nm", 0.05, 0.03, 0.077]];
const ROBOT = {
  name: "pendulum", version: "1.0.0", joints: [{ name: "pivot", type: "continuous", unit_position: "rad", unit_velocity: "rad/s", unit_effort: "Nm", lower: null, upper: null, effort: 2, velocity: 8 }],
  coordinates: [{ name: "pivot", unit: "rad" }], velocities: [{ name: "pivot", unit: "rad/s" }],
  parameters: PARAMETERS.map(([name, unit, prior_mean, prior_sd]) => ({ name, unit, prior_mean, prior_sd })), task: { name: "pendulum", period: 0.02, steps: 200 }, channels: [], may_control: true, why_not: "",
};

/** Numbers between -1 and 1 that are the same every time. */
function chance(seed) {
  let state = seed * 2654435761 % 4294967296;
  return () => (state = (state * 1664525 + 1013904223) % 4294967296) / 2147483648 - 1;
}

function posterior(iteration) {
  const draw = chance(iteration + 7);
  const normal = () => (draw() + draw() + draw()) * 1.0;
  const width = (k) => (iteration === 0 ? 1 : [0.8, 0.5, 0.3, 1e-3][k] / Math.sqrt(iteration));
  const one = ([name, unit, prior_mean, prior_sd, truth], k) => {
    const sd = prior_sd * width(k), mean = iteration === 0 ? prior_mean : truth + 0.3 * sd * draw();
    return { name, unit, mean, sd, quantiles: [-1.96, -0.674, 0, 0.674, 1.96].map((z) => mean + z * sd), prior_mean, prior_sd, determined: iteration > 0 && k === 3 };
  };
  const parameters = PARAMETERS.map(one);
  const sample = (wide) => () => {
    const common = normal();
    return parameters.map(({ mean, sd, prior_mean, prior_sd }, k) => (wide ? prior_mean + prior_sd * normal() : mean + sd * (k < 3 && iteration ? [1, -1, 1][k] * common + 0.05 * normal() : normal())));
  };
  return { utime: BEGIN + iteration * 12e6, iteration, parameters, samples: Array.from({ length: 200 }, sample(false)), prior_samples: Array.from({ length: 200 }, sample(true)) };
}

function calibration(iteration, alarm) {
  const learnt = Array.from({ length: 3 }, (_, i) => 0.0004 * 5 ** i * (1 + 2 / Math.max(1, iteration)));
  return {
    utime: BEGIN + iteration * 12e6, iteration, transitions: 200 * iteration, rollouts: iteration, discrepancy: iteration ? 0.4 + 1 / iteration : null, prior_discrepancy: iteration ? 4.9 : null,
    num_horizons: iteration ? 3 : 0, horizon: iteration ? [1, 5, 20] : [], error_before: iteration ? learnt.map((one) => 1.4 * one) : [], error_after: iteration ? learnt : [], error_prior: iteration ? [0.0027, 0.0156, 0.24] : [],
    kl: iteration ? 14 / iteration ** 2 : null, ess: null, temperature: iteration ? 1 : null, num_combinations: iteration ? 2 : 0, combination: ["gravity / length", "mass length^2"], combination_mean: [9.4477, 1.3034], combination_sd: [2e-4, 6e-5],
    identifiability: iteration ? "only gravity / length and mass length^2 can be known from this motion" : "", seconds: 0.4, streamed_transitions: 0, dropped_gap: 11 * iteration, dropped_late: 3, dropped_not_finite: 1, dropped_restart: 7, dropped_model_based: 0, alarm, gap: alarm && "the learnt residual explains, of 600 free steps, 86 % of the velocities' squared errors",
  };
}

const residual = { condition: 0, num_inputs: 2, num_outputs: 2, num_centres: 3, mean: [0, 0], scale: [1, 1], low: [-2, -2], high: [2, 2], centre: [0, 0, 1, 1, -1, 0.5], weight: Array.from({ length: 12 }, (_, i) => (i < 6 ? 1e-3 : 2e-2) * Math.cos(i)), noise: [1e-3, 0, 6e-3, 2e-2], bound: [0.0106, 0.429], unknown: [3e-4, 2e-2] };

const training = (iteration, update) => ({
  utime: BEGIN + iteration * 12e6, iteration, update, updates: 40, steps: (iteration * 40 + update) * 1600, dropped_episodes: iteration, mean_return: -1200 * Math.exp(-(update + 20 * iteration) / 25) - 150, kl: 0.0075 + 0.002 * Math.sin(update), surrogate_gain: 0.03 * Math.exp(-update / 60),
  explained_variance: 1 - Math.exp(-update / 9), entropy: 1.42 - 0.02 * update - 0.03 * iteration, complete: update === 40, evaluation_return: update === 40 ? -260 + 18 * iteration : null, evaluation_tenth: update === 40 ? -420 + 24 * iteration : null, evaluation_worst: update === 40 ? -610 + 20 * iteration : null,
  incumbent: iteration - 1, incumbent_since: Math.max(0, iteration - 1), decision: iteration ? `policy ${iteration - 1} trusted: the model explains the robot` : "",
});

const controller = (policy_iteration, phase = 3, purpose = 0) => ({ utime: BEGIN, policy_iteration, phase, reason: "", step: 171, episode_return: -365.2, num_episodes: 3, returns: [-300 + 20 * policy_iteration, -280 + 12 * policy_iteration, -330 + 25 * policy_iteration], steps: [200, 100, 150], late_rate: [-0.5, -0.25, -0.5], fell: [false, false, true], episodes_wanted: 3, purpose, episodes_aborted: 4 });

const zeros = Array(20).fill(0);
const bus = (cycles) => ({ name: "", url: "socketcan:can0", up: true, frames_received: cycles * 2, frames_sent: cycles, frames_rejected: 0, frames_dropped: 0, frames_foreign: 0 });
const driver = (state, reason, cycles) => ({
  utime: BEGIN, state, reason, robot: "pendulum", bus: "socketcan:can0", num_buses: 1, buses: [bus(cycles)], joint_name: ["pivot"], joint_state: [state], joint_reason: [""], motor_temperature: [31.5], drive_temperature: [28], bus_voltage: [null], bus_current: [null], drive_identity: ["firmware 0.6.10"], num_sensors: 0, sensor_name: [], sensor_state: [], sensor_reason: [],
  measurements_lost: 1, commands_accepted: Math.floor(cycles / 10), commands_rejected: 0, commands_expired: 0, commands_limited: 12, setpoints_saturated: 0, commands_signed: false, commands_forged: 0, messages_rejected: 0, cycles, overruns: 3, num_bins: 20,
  lateness: zeros.map((_, i) => Math.round(cycles * 0.4 * Math.exp(-((i - 4) ** 2) / 3))).map((one, i) => (i === 13 ? 3 : one)), phase_name: ["receive", "publish", "command", "control", "send"],
  phase_duration: [2, 3, 1, 4, 5].flatMap((middle) => zeros.map((_, i) => Math.round(cycles * 0.5 * Math.exp(-((i - middle) ** 2) / 2)))),
});
const estimator = { valid: true, reason: "", joint_name: ["pivot"], age: [0.001], position_nis: [0.93], velocity_nis: [1.1], acceleration_nis: [null], bias: [null], joint_reason: [""], measurements: 123456, refused: 2, duplicates: 5, reordered: 0, restarts: 17, outages: 1, imu_readings: 654321, imu_refused: 0, imu_duplicates: 13, imu_reordered: 19, model_restarts: 0 };

function solids(angle, alpha) {
  const colour = { r: 0.35, g: 0.6, b: 0.58, a: alpha };
  const orientation = { x: 0, y: Math.sin(angle / 2), z: 0, w: Math.cos(angle / 2) };
  const at = (l) => ({ position: { x: l * Math.sin(angle), y: 0, z: 1.5 + l * Math.cos(angle) }, orientation });
  return { cylinders: [{ pose: at(0.5), size: { x: 0.06, y: 0.06, z: 1 }, bottom_scale: 1, top_scale: 1, color: colour }], spheres: [{ pose: at(1), size: { x: 0.22, y: 0.22, z: 0.22 }, color: colour }], cubes: [{ pose: at(0), size: { x: 0.14, y: 0.2, z: 0.14 }, color: colour }] };
}

/** What has been said before anybody came. */
function past({ alarm = "", iterations = 6, judged = false }) {
  const said = [];
  for (let i = 0; i <= iterations; i++) {
    said.push(["CALIBRATION_STATUS", calibration(i, i === iterations ? alarm : "")], ["PLUMB_POSTERIOR", posterior(i)]);
    for (let update = 0; update <= 40; update += 2) said.push(["TRAINING_STATUS", training(i, update)]);
    said.push(["CONTROLLER_STATUS", controller(i, 3, Number(judged && i === iterations))]);
  }
  said.push(["PARAMETER_DISTRIBUTION", { iteration: iterations, residual: alarm ? [residual] : [] }], ["ESTIMATOR_STATUS", estimator], ["DRIVER_STATUS", driver(1, "", 1000)]);
  return said;
}

/** What is counted of a channel, the k-th; one that was never heard has no numbers. */
function counted(channel, k, tick, age_ms) {
  const type = `${channel.toLowerCase()}_t`;
  const intervals = Array.from({ length: 24 }, (_, bin) => (channel === "IMU" ? 0 : tick * ([10, 80, 9, 1][bin - 8 - Math.floor(k / 2)] ?? 0)));
  if (channel === "IMU") return { channel, type, count: 0, rate: null, jitter_ms: null, bytes_per_second: null, undecodable: 0, refused: 0, intervals, age_ms: null };
  return { channel, type, count: tick * (k + 1), rate: 50 / (k + 1), jitter_ms: k === 6 ? null : 0.3 * k, bytes_per_second: 9000 / (k + 1), undecodable: k % 3 === 2 ? 7 * k : 0, refused: k % 4 === 1 ? 12345 + k : 0, intervals, age_ms };
}

/** Starts it. @returns its address, what it has said of all channels, what was asked of it, and how to end it. `story` is changed as the test likes. */
export async function serve(folder, port = 0, story = {}) {
  const asked = [], saidOfChannels = [], spoken = new Map(), begun = Date.now(), clients = new Set(), topics = ["PLUMB_GATEWAY", "PLUMB_PREDICTION", "PLUMB_SCENE", "PLUMB_POSTERIOR", "ROBOT_STATE", "PLACE_ROBOT", "PARAMETER_DISTRIBUTION", "DRIVER_STATUS", "ESTIMATOR_STATUS", "CONTROLLER_STATUS", "CALIBRATION_STATUS", "TRAINING_STATUS", "PLUMB_CHANNELS"];
  let state = 1;
  const http = createServer((request, response) => {
    const name = request.url === "/" ? "index.html" : request.url.slice(1);
    const headers = { "Content-Security-Policy": "default-src 'self'", "Content-Type": TYPES[name.split(".").pop()] ?? "text/plain" };
    try {
      response.writeHead(200, headers).end(name === "robot.json" ? JSON.stringify({ ...ROBOT, ...story.robot }) : readFileSync(`${folder}/${name}`));
    } catch {
      response.writeHead(404).end("no such file");
    }
  });
  const send = (client, topic, message, utime = message.utime ?? BEGIN) => {
    const id = client.wanted.get(topic);
    if (id === undefined || client.readyState !== 1) return;
    const head = Buffer.alloc(13);
    head.writeUInt8(1, 0), head.writeUInt32LE(id, 1), head.writeBigUInt64LE(BigInt(utime) * 1000n, 5);
    client.send(Buffer.concat([head, Buffer.from(JSON.stringify(message))]));
  };
  const answer = { emergency_stop: [4, "stopped by request"], arm: [3, "armed"], disarm: [1, "disarmed"], confirm_placed: [3, "told the controller"] };
  new WebSocketServer({ server: http, handleProtocols: (offered) => (offered.has("foxglove.websocket.v1") ? "foxglove.websocket.v1" : false) }).on("connection", (client) => {
    clients.add(client);
    client.wanted = new Map();
    client.on("close", () => clients.delete(client));
    client.send(JSON.stringify({ op: "serverInfo", name: "mock", capabilities: ["services"], supportedEncodings: ["json"], sessionId: "1" }));
    client.send(JSON.stringify({ op: "advertise", channels: topics.map((topic, id) => ({ id, topic, encoding: "json", schemaName: topic, schema: "{}", schemaEncoding: "jsonschema" })) }));
    client.send(JSON.stringify({ op: "advertiseServices", services: SERVICES.map((name, id) => ({ id, name, type: name, requestSchema: "", responseSchema: "" })) }));
    client.on("message", (data, binary) => {
      if (!binary) {
        for (const { id, channelId } of JSON.parse(data).subscriptions ?? []) {
          client.wanted.set(topics[channelId], id);
          for (const [topic, message] of past(story)) if (topic === topics[channelId]) send(client, topic, message);
        }
      } else if (data[0] === 2) {
        const service = SERVICES[data.readUInt32LE(1)], call = data.readUInt32LE(5);
        asked.push(service);
        let text;
        [state, text] = answer[service];
        const head = Buffer.alloc(13), encoding = Buffer.from("json");
        head.writeUInt8(3, 0), head.writeUInt32LE(data.readUInt32LE(1), 1), head.writeUInt32LE(call, 5), head.writeUInt32LE(4, 9);
        const reply = () => client.send(Buffer.concat([head, encoding, Buffer.from(JSON.stringify({ ok: true, text }))]));
        if (service === story.late) story.answerLate = reply;
        else reply();
      }
    });
  });
  // Of the newest message, or of a process that has fallen silent before anybody came: story.ages [ms].
  const age = (channel) => {
    const old = story.ages?.[channel];
    return old !== undefined ? old + Date.now() - begun : spoken.has(channel) ? Date.now() - spoken.get(channel) : null;
  };
  let tick = 0;
  const timer = setInterval(() => {
    if (story.still) return;
    tick++;
    const utime = BEGIN + 80e6 + tick * 20_000, t = tick * 0.02, angle = 2.6 * Math.sin(1.3 * t), off = 4e-3 * Math.sin(9 * t);
    for (const client of clients) {
      const tell = (topic, message) => {
        spoken.set(topic, Date.now());
        send(client, topic, { utime, ...message }, utime);
      };
      tell("PLUMB_PREDICTION", { sequence: tick, q: [angle + off], v: [3.4 * Math.cos(1.3 * t)], q_measured: [angle] });
      tell("PLUMB_SCENE", { deletions: [], entities: [{ id: "robot", ...solids(angle, 1) }, { id: "prediction", ...solids(angle + 0.09, 0.4) }, { id: "ground" }] });
      tell("ROBOT_STATE", { sequence: tick, num_joints: 1, q: [angle], v: [3.4 * Math.cos(1.3 * t)], q_sd: [1.2e-4], v_sd: [0.02], effort: [0.3], contact: [], valid: true });
      if (tick % 5 === 0 && !story.silent) tell("DRIVER_STATUS", { ...driver(state, state === 4 ? "emergency stop by request" : "", tick + 1000), ...story.driver }), tell("CONTROLLER_STATUS", controller(6, story.placing ? 1 : 2, Number(story.judged ?? false))), tell("ESTIMATOR_STATUS", estimator);
      // Channels last, and asked for last: who sees them has been told all that there is.
      if (tick % 25 === 0) {
        tell("PLUMB_GATEWAY", { clock: story.clock ?? "real", speed: story.clock ? 14 : 1, clients: clients.size, dropped: 0 });
        if (story.placing) tell("PLACE_ROBOT", { q: [-0.773], v: [0.812] });
        saidOfChannels.push(topics.slice(4, -1).concat("JOINT_STATE", "JOINT_COMMAND", "IMU").map((channel, k) => counted(channel, k, tick, age(channel))));
        tell("PLUMB_CHANNELS", { channels: saidOfChannels.at(-1) });
      }
    }
  }, 20);
  await new Promise((resolve) => http.listen(port, "127.0.0.1", resolve));
  const close = () => {
    clearInterval(timer);
    for (const client of clients) client.terminate();
    return new Promise((resolve) => http.close(resolve), http.closeAllConnections());
  };
  return { url: `http://127.0.0.1:${http.address().port}/`, port: http.address().port, begun, asked, saidOfChannels, counting: { ESTIMATOR_STATUS: estimator, CONTROLLER_STATUS: controller(6), CALIBRATION_STATUS: calibration(6, "") }, close };
}

if (import.meta.url === pathToFileURL(process.argv[1] ?? "").href) {
  console.log((await serve(process.argv[2], Number(process.argv[3] ?? 8765), { alarm: "the model cannot explain this log: all joints; pivot: errors beyond the noise", placing: true })).url);
}
