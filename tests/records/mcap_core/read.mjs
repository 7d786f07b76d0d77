// Reads an MCAP file by the official reader, twice: by its indexes, and as a stream with all checksums. Every message is valid by
// the schema that the file gives it, and a foxglove.SceneUpdate by Foxglove's own, with no field that it does not know. Prints a
// line of JSON for each message, in order of time, with its data as they are in the file.
import { readFile } from "node:fs/promises";
import { createRequire } from "node:module";

const require = createRequire(process.env.MCAP_MODULES + "/");
const { McapIndexedReader, McapStreamReader } = require("@mcap/core");
const { decompress } = require("fzstd");
const { SceneUpdate } = require("@foxglove/schemas/jsonschema");
const { Ajv2020 } = require("ajv/dist/2020");

/** The schema with nothing allowed besides what it names. */
function closed(schema) {
  if (Array.isArray(schema)) return schema.map(closed);
  if (schema === null || typeof schema !== "object") return schema;
  const inner = Object.fromEntries(Object.entries(schema).map(([key, value]) => [key, closed(value)]));
  return schema.type === "object" && schema.properties ? { ...inner, additionalProperties: false } : inner;
}
/** Ours says number where a message has null, too: readers of such schemas take no other type for that. */
const lacking = (schema) => JSON.parse(JSON.stringify(schema).replaceAll('"type":"number"', '"type":["number","null"]'));
const ajv = new Ajv2020({ strict: false, allErrors: true });
const validators = new Map();
function validate(schema, name, data) {
  if (!validators.has(schema.id)) {
    const own = JSON.parse(new TextDecoder().decode(schema.data));
    validators.set(schema.id, (name === "foxglove.SceneUpdate" ? [own, SceneUpdate] : [lacking(own)]).map((one) => ajv.compile(closed(one))));
  }
  for (const valid of validators.get(schema.id)) if (!valid(data)) throw new Error(`${name}: ${ajv.errorsText(valid.errors)}`);
}

const decompressHandlers = { zstd: (bytes, size) => decompress(bytes, new Uint8Array(Number(size))) };
const bytes = await readFile(process.argv[2]);

const stream = new McapStreamReader({ decompressHandlers, validateCrcs: true });
stream.append(new Uint8Array(bytes));
let streamed = 0;
for (let record; (record = stream.nextRecord()); ) if (record.type === "Message") streamed++;
if (!stream.done()) throw new Error("the stream has no end");

const file = {
  size: async () => BigInt(bytes.length),
  read: async (offset, size) => new Uint8Array(bytes.subarray(Number(offset), Number(offset + size))),
};
const reader = await McapIndexedReader.Initialize({ readable: file, decompressHandlers });
let indexed = 0;
for await (const message of reader.readMessages()) {
  const channel = reader.channelsById.get(message.channelId);
  const schema = reader.schemasById.get(channel.schemaId);
  const text = new TextDecoder("utf-8", { fatal: true }).decode(message.data);
  validate(schema, schema.name, JSON.parse(text));
  indexed++;
  const head = JSON.stringify({ topic: channel.topic, encoding: channel.messageEncoding, schema: schema.name, schemaEncoding: schema.encoding, logged: String(message.logTime), published: String(message.publishTime) });
  // JavaScript's numbers do not hold all integers.
  console.log(`${head.slice(0, -1)},"data":${text}}`);
}
const told = Number(reader.statistics.messageCount);
if (indexed !== streamed || indexed !== told) throw new Error(`${indexed} indexed, ${streamed} streamed, ${told} told`);
