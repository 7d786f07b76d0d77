// Reads an MCAP file by the official reader, twice: by its indexes, and as a stream with all checksums. Prints a line of JSON
// for each message, in order of time.
import { readFile } from "node:fs/promises";
import { createRequire } from "node:module";

const require = createRequire(process.env.MCAP_MODULES + "/");
const { McapIndexedReader, McapStreamReader } = require("@mcap/core");
const { decompress } = require("fzstd");

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
  JSON.parse(new TextDecoder().decode(schema.data));
  indexed++;
  console.log(JSON.stringify({
    topic: channel.topic, encoding: channel.messageEncoding, schema: schema.name, schemaEncoding: schema.encoding,
    logged: String(message.logTime), published: String(message.publishTime),
    data: JSON.parse(new TextDecoder().decode(message.data)),
  }));
}
const told = Number(reader.statistics.messageCount);
if (indexed !== streamed || indexed !== told) throw new Error(`${indexed} indexed, ${streamed} streamed, ${told} told`);
